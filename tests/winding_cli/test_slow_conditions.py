"""A cell file's solver reaches the node and `winding predict`; a slow run is announced."""

from pathlib import Path

import pytest
from in_process import winding

from cable_fem_node.winding.expected_cost import falling_behind
from winding_cli.run.configuration import configured, warn_of_slowness
from winding_core.run_spec import RunSpec
from winding_ros.topics import FEM
from winding_study.run_parameters import RunParameters

CELL = """\
condition:
  cylinder_diameter_mm: 60
  cable_diameter_mm: 1
  tension_n: 20
  young_mpa: 138000
  bending_factor: 6.0e-5
  free_length_mm: 50
  feed_mm_s: 3
  duration_s: 2
"""
SCALED = f"{CELL}solver:\n  mass_scaling: 200\n  segment_mm: 4\n"


@pytest.fixture
def cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    place = tmp_path / "cell.yaml"
    place.write_text(SCALED, encoding="utf-8")
    return place


def test_the_solver_of_a_cell_is_the_node_s(cell: Path) -> None:
    own = configured(RunSpec.from_cell(cell, {"mass_scaling": 50.0}), {}).own_parameters()
    assert own[FEM]["mass_scaling"] == 50.0
    assert own[FEM]["segment_length"] == pytest.approx(4.0e-3)
    assert not any("mass_scaling" in values for name, values in own.items() if name != FEM)


def test_a_segment_that_cannot_be_wound_is_refused_before_the_run(cell: Path) -> None:
    done = winding(cell.parent, "cell", "check", "cell.yaml", code=0)
    cell.write_text(SCALED.replace("segment_mm: 4", "segment_mm: 20"), encoding="utf-8")
    done = winding(cell.parent, "cell", "check", "cell.yaml", code=2)
    assert "segment_length must be at most 0.3 of the free length 0.05 m" in done.stderr


def test_a_cell_is_predicted_and_what_is_typed_wins(cell: Path) -> None:
    done = winding(cell.parent, "predict", str(cell), "--check", "--tension-n", "30", code=0)
    assert "elements of 4 mm" in done.stdout
    assert "tension 30 N there" in done.stdout
    done = winding(cell.parent, "predict", str(cell), "--element", "solid", code=2)
    assert "bending_factor must be 1" in done.stderr


@pytest.mark.parametrize(("speed", "told"), [(1000.0, True), (0.0, False)])
def test_a_run_that_is_too_fast_for_the_solver_is_told_before_it_begins(
    cell: Path, capsys: pytest.CaptureFixture[str], *, speed: float, told: bool
) -> None:
    cell.write_text(CELL, encoding="utf-8")
    warn_of_slowness(configured(RunSpec.from_cell(cell, {"speed": speed}), {}))
    said = capsys.readouterr().err.splitlines()
    assert len(said) == told
    if told:
        assert "may fall behind the machine: a mass scaling of" in said[0]


def test_a_run_that_no_scaling_helps_is_told_so() -> None:
    # A clock that has always gone on by a second.
    seconds = iter(map(float, range(1000)))
    sentence = falling_behind(RunParameters(case=4).plan(), lambda: next(seconds), pace=1000.0)
    assert "still too much: wind slower, or take longer elements" in sentence
