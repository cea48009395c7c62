from __future__ import annotations

import json
import signal
from pathlib import Path

import pytest
from started import PATIENCE, start, wait_for
from typer.testing import CliRunner

from winding_cli.app import app
from winding_cli.terminal.refusal import REFUSED
from winding_cli.terminal.termination import INTERRUPTED

pytestmark = [pytest.mark.campaign, pytest.mark.slow]

# Long runs with tiny elements: nothing is finished while a test looks at it.
SLOW = ("--element", "solid", "--segment-mm", "1", "--no-models", "--processes", "1")


def _study(*arguments: str, folder: Path):
    return CliRunner().invoke(app, ["study", "--store", str(folder / "store"), *arguments])


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--element", "beam"), "element must be rod or solid, got 'beam'"),
        (("--fem", "theirs"), "fem must be own or published, got 'theirs'"),
        (("--cases", "13"), "cases must be rows 1 to 12 of Table 1, got '13'"),
        (("--cases", "0-3"), "cases must be rows 1 to 12 of Table 1, got '0-3'"),
        (("--cases", "one"), "cases must be numbers such as 1,4 or 7-12, got 'one'"),
        (("--cases", "7-"), "cases must be numbers such as 1,4 or 7-12, got '7-'"),
        (("--cases", "9-7"), "cases must be rows 1 to 12 of Table 1, got '9-7'"),
        (("--seeds", "1,1"), "seeds must be different whole numbers such as 0,1,2, got '1,1'"),
        (("--seeds", "x"), "seeds must be different whole numbers such as 0,1,2, got 'x'"),
        (("--duration-s", "-1"), "duration-s must be positive and finite, got -1.0"),
        (("--segment-mm", "nan"), "segment-mm must be positive and finite, got nan"),
        (("--mass-scaling", "0"), "mass-scaling must be positive and finite, got 0.0"),
        (("--segment-mm", "100"), "segment_length must be at most 0.3 of the free length"),
        (("--law", "rubber"), "law must be one of linear, hencky"),
        (("--law", "hencky"), "case 2: "),
        (("--json", "nowhere/x.json"), "there is no folder nowhere for x.json"),
        (("--fem", "published", "--lengths", "x.csv"), "--fem published winds nothing"),
        (("--calibrate-rig", "--report", "x"), "--calibrate-rig winds nothing"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_bad_input_is_one_sentence_and_leaves_nothing(arguments, sentence, tmp_path) -> None:
    result = _study(*arguments, folder=tmp_path)
    assert result.exit_code == REFUSED
    lines = result.stderr.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("winding: ")
    assert sentence in lines[0]
    assert list(tmp_path.iterdir()) == []


def test_a_report_where_a_file_stands_is_refused(tmp_path) -> None:
    (tmp_path / "taken").write_text("mine")
    result = _study("--report", str(tmp_path / "taken"), folder=tmp_path)
    assert result.exit_code == REFUSED
    assert "taken is not a folder" in result.stderr
    assert (tmp_path / "taken").read_text() == "mine"


def test_a_store_that_cannot_be_written_is_refused(tmp_path) -> None:
    (tmp_path / "store").write_text("a file")
    result = _study("--cases", "4", folder=tmp_path)
    assert result.exit_code == REFUSED
    assert "store is not a folder" in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_one_short_case_gives_tables_that_a_pipe_does_not_cut(tmp_path) -> None:
    out = tmp_path / "study.json"
    arguments = ("--cases", "3,4", "--duration", "7", "--json", str(out))
    result = _study(*arguments, folder=tmp_path)
    assert result.exit_code == 0, result.stderr
    # Seven seconds turn the cylinder by 11.3 rad: both cases reach P1 at 6.3 and 6.6 rad, and P2
    # would need 12.4 and 13.1 rad.
    read = json.loads(out.read_text())
    assert [(c["case"], c["marker"]) for c in read["cells"]] == [(3, 1), (4, 1)]
    assert read["models"] == {}
    assert "No model of h was compared" in read["verdict"]
    assert "…" not in result.stdout
    again = _study(*arguments, folder=tmp_path)
    assert "2 of 2 cases are in" in again.stderr
    assert "study.json was there and is replaced" in again.stderr
    repeated = json.loads(out.read_text())
    first, second = read.pop("identity"), repeated.pop("identity")
    assert repeated == read
    assert first["condition"] == second["condition"]
    assert first["run_id"] != second["run_id"]


def test_runs_too_short_to_compare_are_refused(tmp_path) -> None:
    result = _study("--cases", "4", "--duration", "0.5", folder=tmp_path)
    assert result.exit_code != 0
    assert "no measured marker is wound" in result.stderr


@pytest.mark.slow
def test_the_published_base_winds_nothing_and_keeps_its_weights(tmp_path) -> None:
    out = tmp_path / "study.json"
    result = _study(
        *("--fem", "published", "--json", str(out), "--seeds", "0", "--steps", "5"),
        folder=tmp_path,
    )
    assert result.exit_code == 0, result.stderr
    assert not (tmp_path / "store").exists()
    read = json.loads(out.read_text())
    assert read["mean_error_pct"] == pytest.approx(12.04, abs=0.005)
    assert set(read["weights_by_case"]) == {str(case) for case in range(1, 13)}
    # Least squares of one h per case on the printed lengths, independent of any training.
    assert read["weights_by_case"]["4"]["least_squares"] == pytest.approx(0.998, abs=0.001)
    assert read["weights_by_case"]["4"]["paper"] == pytest.approx(0.9919, abs=1e-4)
    floor = read["models"]["least squares, one h per case"]
    assert floor["in_sample_pct"] == pytest.approx(4.16, abs=0.01)
    assert "within_run" in read["tables"]


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_study_says_what_is_kept(number: int, tmp_path) -> None:
    process = start("study", "--cases", "1", *SLOW, cwd=tmp_path)
    wait_for((tmp_path / "runs" / "study").is_dir, process)
    process.send_signal(number)
    _, output = process.communicate(timeout=PATIENCE)
    assert process.returncode == INTERRUPTED, output
    assert "interrupted: 0 of 1 cases are in" in output.splitlines()[-1]
    assert "Traceback" not in output


@pytest.mark.slow
def test_a_killed_study_started_again_goes_on_and_says_so(tmp_path) -> None:
    store = tmp_path / "runs" / "study"
    arguments = ("--duration", "8", "--no-models", "--processes", "1")
    process = start("study", *arguments, cwd=tmp_path)
    wait_for(lambda: any(store.glob("??/*.npz")), process)
    process.kill()
    process.communicate(timeout=PATIENCE)
    before = {path: path.stat().st_mtime_ns for path in store.glob("??/*.npz")}
    second = start("study", *arguments, cwd=tmp_path)
    _, output = second.communicate(timeout=PATIENCE)
    assert second.returncode == 0, output
    assert f"{len(before)} of 12 cases are in {Path('runs') / 'study'} already" in output
    assert len(list(store.glob("??/*.npz"))) == 12
    assert all(path.stat().st_mtime_ns == written for path, written in before.items())
