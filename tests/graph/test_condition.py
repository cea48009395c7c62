"""A live run of another material: every node winds what was typed."""

import json
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.processes
# Six markers within the 60 mm that three seconds lay.
TYPED = {
    "case": 4,
    "marker_spacing_mm": 10,
    "markers": 6,
    "young_mpa": 4,
    "law": "neo_hookean",
    "friction": 0.2,
    "duration_s": 3,
}


def test_run_of_another_material_tracks_and_corrects_every_marker(
    command: Any, tmp_path: Path
) -> None:
    options = [
        part for key, value in TYPED.items() for part in (f"--{key}".replace("_", "-"), value)
    ]
    ended = command("run", *options, "--speed", 0, "--bag", "bag", "--output", "run", cwd=tmp_path)
    assert ended.returncode == 0, ended.stderr
    record = json.loads((tmp_path / "run" / "run.json").read_text(encoding="utf-8"))
    assert record["case"] == 0
    rows = record["markers"]
    assert [row["id"] for row in rows] == [1, 2, 3, 4, 5, 6]
    # The lay has hidden properties; half the dead weight moves a length by 4 % at 4 MPa.
    assert [row["s_tracked_m"] for row in rows] == pytest.approx(
        [row["s_fem_m"] for row in rows], rel=0.05
    )
    assert None not in [row["s_corrected_m"] for row in rows]
    info = command("bag", "info", "bag", cwd=tmp_path).stdout
    for name, value in (("young_mpa", 4.0), ("markers", 6), ("law", "neo_hookean")):
        assert f"{name} {value}" in " ".join(info.split())
