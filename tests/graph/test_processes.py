"""One run of real processes over DDS, started by the command that people type."""

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.processes


@pytest.fixture(scope="module")
def numbers(recorded_run: Any) -> dict[str, Any]:
    return json.loads(recorded_run.json.read_text(encoding="utf-8"))


def test_run_ends_well_and_shows_its_table(recorded_run: Any) -> None:
    assert recorded_run.finished.returncode == 0, recorded_run.finished.stderr
    for word in ("original", "FEM", "tracked", "corrected", "published", "P4"):
        assert word in recorded_run.finished.stdout


def test_nothing_is_lost(recorded_run: Any, numbers: dict[str, Any]) -> None:
    assert numbers["frames"] == int(recorded_run.duration * 200) + 1
    assert numbers["joint_states"] == int(recorded_run.duration * 1000) + 1
    assert (numbers["frames_lost"], numbers["joint_states_lost"]) == (0, 0)


def test_numbers_have_the_promised_keys(numbers: dict[str, Any]) -> None:
    assert set(numbers) == {
        "case", "ended", "markers", "frames", "frames_lost", "joint_states", "joint_states_lost",
        "wall_s", "sim_s", "identity", "error_verdict",
    }  # fmt: skip
    assert [marker["id"] for marker in numbers["markers"]] == [1, 2, 3, 4]
    assert set(numbers["markers"][0]) == {
        "id", "original_m", "s_fem_m", "s_tracked_m", "h", "s_corrected_m", "s_published_m",
        "error_fem_pct", "error_corrected_pct", "h_held_out", "error_held_out_pct",
    }  # fmt: skip


def test_wound_marker_is_tracked_to_one_percent(numbers: dict[str, Any]) -> None:
    first = numbers["markers"][0]
    assert first["s_tracked_m"] == pytest.approx(first["s_published_m"], rel=0.01)


def test_unwound_markers_are_null_not_invented(numbers: dict[str, Any]) -> None:
    for marker in numbers["markers"][1:]:
        assert marker["s_fem_m"] is None
        assert marker["s_tracked_m"] is None


def test_report_is_one_offline_page(recorded_run: Any) -> None:
    page = recorded_run.report / "index.html"
    text = page.read_text(encoding="utf-8")
    assert [path.name for path in recorded_run.report.iterdir()] == ["index.html"]
    assert 'src="http' not in text
    assert 'href="http' not in text


def test_two_graphs_at_once_in_two_namespaces(command: Any, tmp_path: Path) -> None:
    def run(namespace: str) -> Any:
        return command(
            "run", "--case", 4, "--speed", 0, "--duration-s", 1.0, "--namespace", namespace,
            "--json", tmp_path / f"{namespace}.json",
            cwd=tmp_path,
        )  # fmt: skip

    with ThreadPoolExecutor(2) as pool:
        runs = list(pool.map(run, ("left", "right")))
    for finished in runs:
        assert finished.returncode == 0, finished.stderr
    for namespace in ("left", "right"):
        lost = json.loads((tmp_path / f"{namespace}.json").read_text(encoding="utf-8"))
        assert (lost["frames_lost"], lost["joint_states_lost"]) == (0, 0)
