"""`winding run --json -`: one document on standard output, and everything else beside it."""

import json
from pathlib import Path
from typing import Any

import pytest
from in_process import winding

CELL = "condition: {case: 11, duration_s: 1.3}\nrecording: {json: '-', output: left}\n"


@pytest.mark.processes
@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [("--case", 11, "--duration-s", 1.3, "--output", "left", "--json", "-"), ("cell.yaml",)],
)
def test_json_goes_to_stdout_alone(words: tuple[object, ...], command: Any, tmp_path: Path) -> None:
    (tmp_path / "cell.yaml").write_text(CELL, encoding="utf-8")
    done = command("run", *words, "--speed", 0, cwd=tmp_path, code=0)
    outcome = json.loads(done.stdout)["outcome"]
    assert outcome["done"]["time_s"] == pytest.approx(1.3)
    for sentence in outcome["sentences"]:
        assert sentence in done.stderr
    assert "Curve lengths of case 11" in done.stderr
    assert sorted(path.name for path in (tmp_path / "left").iterdir()) == ["log", "report"]
    assert not (tmp_path / "-").exists()


def test_what_such_a_cell_means_is_printed_as_of_every_other(tmp_path: Path) -> None:
    (tmp_path / "cell.yaml").write_text(CELL, encoding="utf-8")
    done = winding(tmp_path, "cell", "check", "cell.yaml")
    assert (done.exit_code, done.stderr) == (0, "")
    assert f"written {tmp_path / 'left'}" in " ".join(done.stdout.split())
