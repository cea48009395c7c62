"""Bad input: one clear sentence, a non-zero exit, and nothing has moved."""

import os
from pathlib import Path
from typing import Any

import pytest

from winding_supervisor.domain_lock import domain_lock

pytestmark = pytest.mark.processes

OWN = {
    "--cylinder-diameter-mm": 30,
    "--cable-diameter-mm": 4,
    "--tension-n": 2,
    "--marker-spacing-mm": 100,
}


def own(**changed: object) -> list[object]:
    values = OWN | {f"--{name.replace('_', '-')}": value for name, value in changed.items()}
    return [part for pair in values.items() for part in pair]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--case", 13], "case must be one of 1 to 12, got 13"),
        (["--case", 0], "case must be one of 1 to 12, got 0"),
        (["--case", -4], "case must be one of 1 to 12, got -4"),
        ([], "say what to wind: --case 1 to 12"),
        (own(cylinder_diameter_mm=-30), "--cylinder-diameter-mm must be positive, got -30"),
        (own(cable_diameter_mm="nan"), "--cable-diameter-mm must be finite, got nan"),
        (own(tension_n=0), "--tension-n must be positive, got 0"),
        (["--case", 4, "--tension-n", 0], "--tension-n must be positive, got 0"),
        (["--case", 4, "--duration-s", 0], "--duration-s must be positive, got 0"),
        (["--case", 4, "--domain", 233], "whole number of 0 to 232, got 233"),
        (["--case", 4, "--namespace", "a b"], "namespace must be made of letters"),
        (["--case", 4, "--parameters", "absent.yaml"], "no parameter file at absent.yaml"),
        (["--case", 4, "--speed", -1], "parameter speed must be at least 0, got -1"),
        (["--case", 4, "--lay", "silk"], "lay must be one of paper, fem, got 'silk'"),
    ],
)
def test_refused_before_anything_starts(
    command: Any, tmp_path: Path, arguments: list[object], sentence: str
) -> None:
    refused = command("run", *arguments, cwd=tmp_path)
    assert refused.returncode == 2
    assert sentence in refused.stderr
    assert len(refused.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_missing_weights_are_named_by_the_node_that_needs_them(
    command: Any, tmp_path: Path
) -> None:
    refused = command("run", "--case", 4, "--weights", "nowhere", cwd=tmp_path)
    assert refused.returncode == 1
    assert "correction: cannot configure: no trained weights at nowhere" in refused.stderr


def test_unknown_parameter_in_a_file_is_refused_with_the_nearest(
    command: Any, tmp_path: Path
) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("/**/cable_fem:\n  ros__parameters:\n    frictoin: 0.2\n", encoding="utf-8")
    refused = command("run", "--case", 4, "--parameters", file, cwd=tmp_path)
    assert refused.returncode == 1
    assert "has no parameter frictoin; did you mean friction?" in refused.stderr


def test_existing_bag_is_never_overwritten(command: Any, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    refused = command("run", "--case", 4, "--bag", bag, cwd=tmp_path)
    assert refused.returncode == 2
    assert "exists already; a recording is never overwritten" in refused.stderr
    assert list(bag.iterdir()) == []


def test_domain_and_namespace_in_use_are_refused(command: Any, tmp_path: Path) -> None:
    domain = int(os.environ["ROS_DOMAIN_ID"])
    with domain_lock(domain, "taken"):
        refused = command("run", "--case", 4, "--namespace", "taken", cwd=tmp_path)
    assert refused.returncode == 2
    assert f"DDS domain {domain} already runs a graph in namespace /taken" in refused.stderr
