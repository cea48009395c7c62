"""A drum in a run: what follows of it, and what would leave it is refused beforehand."""

import math
from pathlib import Path
from typing import Any

import pytest

from winding_cli.run.configuration import configured
from winding_cli.terminal.record_options import spelled
from winding_core.parameters import ParameterError
from winding_core.run_spec import RunSpec
from winding_ros.graph import LAY_CONTROL, RIG

DRUM = {"case": 9, "drum_width_mm": 34.0, "flange_mm": 20.0}
FILLED = {**DRUM, "layers": 3}


def config_of(folder: Path, **options: Any) -> Any:
    return configured(RunSpec.from_cell(None, {**options, "output": folder / "run"}, spelled), {})


def test_a_drum_is_driven_until_it_is_full(tmp_path: Path) -> None:
    config = config_of(tmp_path, **FILLED)
    spec, wound = config.spec, config.spec.wound_drum
    assert spec.controlled
    assert spec.lay.control == "drive"
    assert spec.simulated_lay == "driven"
    what = spec.condition.resolved()
    turned = what.drive.positions(what.duration)[0]
    # A few milliseconds early: the cylinder comes to rest a little beyond its place.
    assert 0.0 < wound.theta[-1] - turned < what.drive.angular_speed * 5e-3
    # The rig knows the drum and nothing of how it is to be filled; the controller knows both.
    nodes = config.parameters()
    assert nodes[RIG.name]["drum_width"] == nodes[LAY_CONTROL.name]["drum_width"] == 0.034
    assert nodes[LAY_CONTROL.name]["layers"] == 3
    assert not {"layers", "length", "winding"} & nodes[RIG.name].keys()


def test_a_cell_file_holds_a_drum(tmp_path: Path) -> None:
    spec = RunSpec.from_cell(None, FILLED)
    file = tmp_path / "cell.yaml"
    file.write_text(spec.text(), encoding="utf-8")
    assert RunSpec.from_cell(file, {}) == spec


def test_a_helix_within_the_flanges_is_a_run_on_a_drum(tmp_path: Path) -> None:
    config = config_of(tmp_path, case=9, drum_width_mm=120.0, flange_mm=20.0)
    assert not config.spec.controlled
    assert config.spec.simulated_lay == "driven"


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (DRUM, "would leave the drum after 2.574 turns and come to z = 79.79 mm"),
        ({**DRUM, "start_side": "high"}, "it lies from -30 to 0 mm"),
        ({**DRUM, "control": "drive", "pitch_mm": 8.0}, "would leave the drum after 3.75 turns"),
        ({**DRUM, "duration_s": 3600.0}, "come to z = 1.798e+04 mm"),
        ({**FILLED, "control": "watch"}, "--control must be drive to fill a drum"),
        ({**FILLED, "layers": 9}, "9 layers would pass the flanges, 20 mm high"),
        ({**FILLED, "duration_s": 500.0}, "what goes on the drum is wound in 87.161 s"),
        ({**FILLED, "program": "lay.csv"}, "a drum has a program of its own: leave out --program"),
        ({**FILLED, "lay": "fem"}, "use driven"),
        ({**FILLED, "edge_dwell_turns": 0.5}, "orthocyclic winding has no --edge-dwell-turns"),
        ({"case": 9, "layers": 3}, "--drum-width-mm is missing"),
    ],
)
def test_bad_drums_are_refused(tmp_path: Path, options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ParameterError) as caught:
        config_of(tmp_path, **options)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_turns_follow_from_width_and_pitch() -> None:
    wound = RunSpec.from_cell(None, {**FILLED, "pitch_mm": 5.0}).wound_drum
    # 34 mm hold 7 turns 5 mm apart, and none of half a pitch more: every other layer has 6.
    assert [layer.z.size for layer in wound.layers] == [7, 6, 7]
    assert math.isclose(wound.pitch, 5.0e-3)
