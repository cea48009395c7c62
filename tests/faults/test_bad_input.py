"""Bad input: one clear sentence, a non-zero exit, and nothing has moved."""

import os
import shutil
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from correction_node.models.weights import weights_directory
from winding_cli.app import app
from winding_ros.runtime.parameter_files import parameters_for
from winding_supervisor.session.domain_lock import domain_lock

OWN = {
    "--cylinder-diameter-mm": 30,
    "--cable-diameter-mm": 4,
    "--tension-n": 2,
    "--marker-spacing-mm": 100,
}


def own(**changed: object) -> list[object]:
    values = OWN | {f"--{name.replace('_', '-')}": value for name, value in changed.items()}
    return [part for pair in values.items() for part in pair]


REFUSED: list[tuple[list[object], str]] = [
    (["--case", 13], "case must be one of 1 to 12, got 13"),
    (["--case", 0], "case must be one of 1 to 12, got 0"),
    (["--case", -4], "case must be one of 1 to 12, got -4"),
    ([], "say what to wind: --case 1 to 12"),
    (own(cylinder_diameter_mm=-30), "--cylinder-diameter-mm must be positive, got -30"),
    (own(cable_diameter_mm="nan"), "--cable-diameter-mm must be finite, got nan"),
    (own(tension_n=0), "--tension-n must be positive, got 0"),
    (["--case", 4, "--tension-n", 0], "--tension-n must be positive, got 0"),
    (["--case", 4, "--young-mpa", -4], "--young-mpa must be positive, got -4"),
    (["--case", 4, "--young-mpa", 4, "--lay", "paper"], "--lay paper is what the paper measured"),
    (["--case", 4, "--young-mpa", 0.1, "--law", "hencky"], "law hencky carries at most"),
    (["--case", 4, "--duration-s", 0], "--duration-s must be positive, got 0"),
    (["--case", 4, "--domain", 233], "--domain must be at most 232, got 233"),
    (["--case", 4, "--namespace", "a b"], "namespace must be made of letters"),
    (["--case", 4, "--parameters", "absent.yaml"], "--parameters: there is no file absent.yaml"),
    (["--case", 4, "--speed", -1], "--speed must be at least 0, got -1"),
    (["--case", 4, "--lay", "driven", "--compose", "camera"],
     "--lay driven is shown by the rig's own camera alone"),
    (["--case", 4, "--element", "shell"], "--element must be one of rod, solid, got 'shell'"),
    (["--case", 4, "--element", "solid", "--prony", "0.2:1.5"],
     "the solid element knows elastic cables alone: leave out prony"),
    (["--case", 4, "--element", "solid", "--axial-factor", 0.9],
     "the solid element has no separate stiffnesses: axial_factor must be 1, got 0.9"),
    (["--case", 4, "--element", "solid", "--law", "hencky_cauchy"],
     "the solid element needs a law with stored energy: take law hencky"),
    (["--case", 4, "--element", "solid", "--feed-mm-s", 1],
     "the guide advances 3.61 mm per turn and the cable lags behind it"),
    (["--case", 4, "--element", "solid", "--machine", "external", "--turns", 2],
     "an external machine cannot wait for element solid"),
    (["--case", 4, "--element", "solid", "--parameters", "taking_up.yaml"],
     "take_up_material goes on with a rod of the identified modulus: leave it out"),
    (["--case", 4, "--lay", "silk"], "lay must be one of paper, fem, driven, got 'silk'"),
    (["--case", 4, "--weights", "nowhere"], "no trained weights at nowhere"),
    (["--case", 4, "--weights", "damaged"], "damaged/weights.safetensors does not match its card"),
    (["--case", 4, "--parameters", "unknown.yaml"], "cable_fem has no parameter frictoin; did you"),
    (["--case", 4, "--parameters", "range.yaml"], "winding_rig: parameter speed must be at least"),
    (["--case", 4, "--parameters", "broken.yaml"], "broken.yaml is not a parameter file"),
    (["--case", 4, "--output", "a_file"], "a_file exists already; a run is never written over"),
    (["--case", 4, "--bag", "damaged"], "damaged exists already; a recording is never overwritten"),
    (["--case", 4, "--secure"], "a secure run needs ROS_SECURITY_ENABLE=true, got nothing"),
    (["--case", 4, "--report", "a_file"], "a_file is not a folder"),
    (["--case", 4, "--json", "damaged"], "damaged is a folder, not a file"),
    (["--case", 4, "--truth", "damaged"], "damaged is a folder, not a file"),
]  # fmt: skip


@pytest.fixture
def given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Bring a folder of bad input, in which commands run."""
    monkeypatch.chdir(tmp_path)
    texts = {
        "unknown.yaml": "/**/cable_fem:\n  ros__parameters:\n    frictoin: 0.2\n",
        "range.yaml": "/winding/winding_rig:\n  ros__parameters:\n    speed: -1e3\n",
        "broken.yaml": "a: [1, x",
        "taking_up.yaml": "/**/cable_fem:\n  ros__parameters:\n    take_up_material: true\n",
        "a_file": "",
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    shutil.copytree(weights_directory("rod"), tmp_path / "damaged")
    (tmp_path / "damaged" / "weights.safetensors").write_bytes(b"other")
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize(("arguments", "sentence"), REFUSED)
def test_bad_input_is_refused_at_once(given: Path, arguments: list[object], sentence: str) -> None:
    before = sorted(given.rglob("*"))
    refused = CliRunner().invoke(app, ["run", *map(str, arguments)])
    assert refused.exit_code == 2, refused.stderr
    assert sentence in refused.stderr
    assert refused.stderr.count("\n") == 1, refused.stderr
    assert sorted(given.rglob("*")) == before


def test_parameter_file_is_read_as_rcl_reads_it(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("/**:\n  ros__parameters:\n    speed: 1e1\n    use_sim_time: true\n")
    assert parameters_for(file, "/winding/winding_rig") == {"speed": 10.0, "use_sim_time": True}


@pytest.mark.processes
def test_domain_and_namespace_in_use_are_refused(command: Any, tmp_path: Path) -> None:
    domain = int(os.environ["ROS_DOMAIN_ID"])
    with domain_lock(domain, "taken"):
        refused = command("run", "--case", 4, "--namespace", "taken", cwd=tmp_path)
    assert refused.returncode == 2
    assert f"DDS domain {domain} already runs a graph in namespace /taken" in refused.stderr
