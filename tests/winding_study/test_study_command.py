"""`winding study`: its record, its pictures and its options."""

import dataclasses
import json
import math
import signal
from pathlib import Path

import numpy as np
import pytest
from accessibility import grave_findings, opened
from chromium import chromium
from printed_page import missing_from_paper, outside_the_margins, printed_words
from report_page import ReportPage
from started import PATIENCE, start, wait_for
from typer.testing import CliRunner

from correction_node.live.neighbours import Noise
from correction_node.models.dataset import join_experiment
from correction_node.training.comparison import (
    BASELINE,
    LEARNED,
    ONE_H_PER_CASE,
    ORACLE,
    ModelScore,
)
from correction_node.training.evaluation import cell_errors_pct
from correction_node.training.training import RIG
from winding_cli.app import app
from winding_cli.terminal.refusal import FAILED, REFUSED
from winding_cli.terminal.termination import INTERRUPTED
from winding_core.cable.cases import Lay, paper_case, published_markers
from winding_study.paper.case_result import CaseResult, compare, compare_paper
from winding_study.paper.study import StudyConfig, predicted_lengths
from winding_study.paper.study_record import StudyRecord
from winding_study.paper.study_report import render_study, write_study
from winding_verification.correction.tables import NoiseAccuracy, noise_table

pytestmark = [pytest.mark.campaign, pytest.mark.slow]

TEN_PCT = 1.1
# Long runs with tiny elements: nothing is finished while a test looks at it.
SLOW = ("--element", "solid", "--segment-mm", "1", "--no-models", "--processes", "1")


def _wound(case: int) -> CaseResult:
    """A coil that lies as the experiment's, a tenth longer: made of closed forms, not wound."""
    condition = paper_case(case)
    turn = np.linspace(0.0, 4.0 * np.pi, 60)
    radius = condition.centreline_radius
    return CaseResult(
        case=case,
        lays={
            row.marker: Lay(
                theta=row.experiment.theta, z=row.experiment.z, s=TEN_PCT * row.experiment.s
            )
            for row in published_markers(case)
            if row.experiment
        },
        path_z={},
        energy_balance_pct=0.5,
        cpu_seconds=1.0,
        nodes=np.column_stack([radius * np.cos(turn), -radius * np.sin(turn), 2e-3 * turn]),
        strain=np.full(60, 0.1),
    )


def _score(cells, kind: str, seen: float, unseen: float) -> ModelScore:
    """A model that is wrong by the same share everywhere."""
    exact = np.array([cell.s_exp / cell.s_fem for cell in cells])
    in_sample, held_out = (1.0 + 0.01 * seen) * exact, (1.0 + 0.01 * unseen) * exact
    left_out = cell_errors_pct(cells, held_out)
    return ModelScore(
        kind=kind,
        description=f"A {kind} of the test.",
        in_sample_pct=float(cell_errors_pct(cells, in_sample).mean()),
        leave_one_case_out_pct=float(left_out.mean()),
        worst_case_pct=float(left_out.max()),
        in_sample_spread_pct=0.2,
        leave_one_case_out_spread_pct=0.4 if math.isfinite(unseen) else math.nan,
        in_sample=in_sample,
        held_out=held_out,
    )


def _record(learned: float = 3.0, plain: float = 5.0) -> StudyRecord:
    results = tuple(_wound(case) for case in range(1, 13))
    lengths = {(case, marker): s for case, marker, s in predicted_lengths(results)}
    cells = join_experiment(lengths, source="test")
    return StudyRecord(
        config=StudyConfig(),
        cases=tuple(range(1, 13)),
        comparison=compare(results),
        results=results,
        cells=cells,
        models={
            "network": _score(cells, LEARNED, 1.0, learned + 1.0),
            "<other> & model": _score(cells, LEARNED, 0.5, learned),
            "sigma/E": _score(cells, BASELINE, plain, plain),
            ONE_H_PER_CASE: _score(cells, ORACLE, 0.1, math.nan),
        },
        noise=noise_table(
            [
                NoiseAccuracy(noise=noise, kind=kind, accuracy=0.9)
                for kind in Noise
                for noise in (0.01, 0.02)
            ]
        ),
    )


# One process computes what the tests of this file share.
@pytest.fixture(scope="module")
def record() -> StudyRecord:
    return _record()


@pytest.fixture(scope="module")
def small(record: StudyRecord) -> StudyRecord:
    """Everything but eleven of the twelve drawn cables."""
    return dataclasses.replace(record, results=record.results[3:4])


@pytest.fixture(scope="module")
def page(record: StudyRecord) -> str:
    return render_study(record, stored=3)


def test_the_best_model_is_the_one_that_does_best_on_cases_left_out(record: StudyRecord) -> None:
    assert record.best_model == record.best_learned == "<other> & model"
    assert "'sigma/E', loses" in record.verdict()


def test_a_plain_baseline_that_wins_is_said_to_win() -> None:
    beaten = _record(learned=6.0, plain=4.0)
    assert beaten.best_model == "sigma/E"
    assert beaten.best_learned == "<other> & model"
    assert "'sigma/E', wins" in beaten.verdict()


def test_physics_chosen_with_the_answers_in_view_is_called_optimistic(record) -> None:
    rig = {RIG if name == "<other> & model" else name: m for name, m in record.models.items()}
    assert "optimistic" in dataclasses.replace(record, models=rig).verdict()
    assert "optimistic" not in record.verdict()


def test_a_floor_is_no_model(record: StudyRecord) -> None:
    scores = record.as_json()["models"]
    assert scores[ONE_H_PER_CASE]["leave_one_case_out_pct"] is None
    assert scores[ONE_H_PER_CASE]["kind"] == ORACLE


def test_the_json_is_strict_and_has_what_readers_ask_for(record: StudyRecord) -> None:
    read = json.loads(json.dumps(record.as_json(), allow_nan=False))
    # S_FEM is 1.1 S_EXP everywhere.
    assert read["mean_error_pct"] == pytest.approx(100.0 * 0.1 / 1.1)
    assert read["means"]["error_pct"] == read["mean_error_pct"]
    assert read["means"]["paper_error_pct"] == pytest.approx(12.04, abs=0.005)
    assert read["means"]["paper_updated_error_pct"] == pytest.approx(4.81, abs=0.005)
    assert read["models"]["network"]["in_sample_spread_pct"] == 0.2
    assert read["best_model"] == "<other> & model"
    assert {f"table_{n}" for n in range(2, 9)} <= set(read["tables"])
    assert {"models", "weights", "neighbours_simulated"} <= set(read["tables"])
    assert read["weights_by_case"]["4"]["network"] == pytest.approx(1.01 / 1.1, rel=1e-12)


def test_table_8_shows_the_paper_the_network_and_the_best(record: StudyRecord) -> None:
    means = next(t for t in record.paper_tables() if t.name == "table_8").means
    # 100 |S - 1.01 S| / (1.01 S) for the network's in-sample h, and so on.
    assert means["network, in-sample"] == pytest.approx(100.0 * 0.01 / 1.01)
    assert means["network, left out"] == pytest.approx(100.0 * 0.04 / 1.04)
    assert means["<other> & model, left out"] == pytest.approx(100.0 * 0.03 / 1.03)
    assert means["paper, as printed"] == pytest.approx(4.81, abs=0.005)


def test_the_papers_weights_stand_beside_ours_when_its_simulation_is_the_base() -> None:
    cells = join_experiment(
        {(row.case, row.marker): row.simulation.s for row in published_markers()}, source="test"
    )
    published = StudyRecord(
        config=None,
        cases=tuple(range(1, 13)),
        comparison=compare_paper(),
        cells=cells,
        models={"network": _score(cells, LEARNED, 1.0, 3.0)},
    )
    assert published.factors_by_case()[1]["paper"] == pytest.approx(1.1636)
    assert published.as_json()["base"] == "paper's simulation"
    assert "Without any correction our" not in published.verdict()
    assert ReportPage(render_study(published)).headings[0] == "The paper's twelve cases"


def test_noise_stands_in_percent_with_a_column_for_each_kind(record: StudyRecord) -> None:
    assert record.noise.rows == ((1.0, 90.0, 90.0), (2.0, 90.0, 90.0))
    assert "imulated" in record.noise.note


def test_without_models_the_verdict_says_why(small: StudyRecord) -> None:
    bare = dataclasses.replace(small, models={}, cells=(), noise=None)
    assert "No model of h was compared" in bare.verdict()
    assert bare.as_json()["best_model"] is None
    assert "Models of the weight" not in render_study(bare)


def test_one_case_alone_makes_a_page() -> None:
    result = _wound(4)
    alone = StudyRecord(
        config=StudyConfig(), cases=(4,), comparison=compare([result]), results=(result,)
    )
    headings = ReportPage(render_study(alone)).headings
    assert headings[0] == "Case 4"
    assert not any(heading.startswith("Table 2") for heading in headings)
    assert any(heading.startswith("Table 3") for heading in headings)


def test_the_page_has_every_table_and_figure_and_loads_nothing(page: str) -> None:
    read = ReportPage(page)
    read.require_whole()
    for name in (*(f"Table {number}:" for number in range(2, 9)), "Figure 7", "Figure 9"):
        assert any(heading.startswith(name) for heading in read.headings), name
    assert any(heading.startswith("Figure 11") for heading in read.headings)
    assert len(read.anchors) > 10


def test_every_table_cell_is_on_paper(page: str, tmp_path) -> None:
    path = tmp_path / "index.html"
    path.write_text(page, encoding="utf-8")
    words = printed_words(path, tmp_path)
    assert not missing_from_paper(page, words)
    assert outside_the_margins(words) == []


def test_names_of_models_cannot_become_markup(page: str) -> None:
    assert "<other>" not in page
    assert "&lt;other&gt; &amp; model" in page


def test_the_same_study_gives_the_same_bytes() -> None:
    result = _wound(8)
    alone = StudyRecord(
        config=StudyConfig(), cases=(8,), comparison=compare([result]), results=(result,)
    )
    assert render_study(alone) == render_study(alone)


def test_the_folder_has_the_page_and_a_csv_file_of_every_table(small, tmp_path) -> None:
    path = write_study(small, tmp_path / "deep" / "study")
    names = {file.name for file in path.parent.iterdir()}
    assert names == {
        "index.html",
        *(f"table_{number}.csv" for number in range(2, 9)),
        "models.csv",
        "weights.csv",
        "neighbours_simulated.csv",
    }
    assert len((path.parent / "table_7.csv").read_text().splitlines()) == 49


@pytest.mark.parametrize("width", [1280, 390])
def test_axe_finds_nothing_grave_on_the_study(page: str, tmp_path: Path, width: int) -> None:
    file = tmp_path / "study.html"
    file.write_text(page, encoding="utf-8")
    with chromium() as browser:
        shown = opened(browser, file.as_uri(), width=width, dark=False)
        assert grave_findings(shown) == []


def _study(*arguments: str, folder: Path, code: int = 0):
    done = CliRunner().invoke(app, ["study", "--store", str(folder / "store"), *arguments])
    assert done.exit_code == code, done.output
    return done


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
    result = _study(*arguments, folder=tmp_path, code=REFUSED)
    lines = result.stderr.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("winding: ")
    assert sentence in lines[0]
    assert list(tmp_path.iterdir()) == []


def test_a_report_where_a_file_stands_is_refused(tmp_path) -> None:
    (tmp_path / "taken").write_text("mine")
    result = _study("--report", str(tmp_path / "taken"), folder=tmp_path, code=REFUSED)
    assert "taken is not a folder" in result.stderr
    assert (tmp_path / "taken").read_text() == "mine"


def test_a_store_that_cannot_be_written_is_refused(tmp_path) -> None:
    (tmp_path / "store").write_text("a file")
    result = _study("--cases", "4", folder=tmp_path, code=REFUSED)
    assert "store is not a folder" in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_one_short_case_gives_tables_that_a_pipe_does_not_cut(tmp_path) -> None:
    out = tmp_path / "study.json"
    arguments = ("--cases", "3,4", "--duration", "7", "--json", str(out))
    result = _study(*arguments, folder=tmp_path)
    # Seven seconds turn the cylinder by 11.3 rad: both cases reach P1 at 6.3 and 6.6 rad, and P2
    # would need 12.4 and 13.1 rad.
    read = json.loads(out.read_text())
    assert [(c["case"], c["marker"]) for c in read["cells"]] == [(3, 1), (4, 1)]
    assert read["models"] == {}
    assert "No model of h was compared" in read["verdict"]
    assert "…" not in result.stdout
    refused = _study(*arguments, folder=tmp_path, code=REFUSED)
    assert f"--json: {out} exists already; --force replaces it" in refused.stderr
    assert "2 of 2 cases are in" in _study(*arguments, "--force", folder=tmp_path).stderr
    repeated = json.loads(out.read_text())
    first, second = read.pop("identity"), repeated.pop("identity")
    assert repeated == read
    assert first["condition"] == second["condition"]
    assert first["run_id"] != second["run_id"]


def test_runs_too_short_to_compare_are_refused(tmp_path) -> None:
    result = _study("--cases", "4", "--duration", "0.5", folder=tmp_path, code=FAILED)
    assert "no measured marker is wound" in result.stderr


def test_the_published_base_winds_nothing_and_keeps_its_weights(tmp_path) -> None:
    out = tmp_path / "study.json"
    result = _study(
        *("--fem", "published", "--json", str(out), "--seeds", "0", "--steps", "5"), folder=tmp_path
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


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_study_says_what_is_kept(number: int, tmp_path) -> None:
    process = start("study", "--cases", "1", *SLOW, cwd=tmp_path)
    wait_for((tmp_path / "runs" / "study").is_dir, process)
    process.send_signal(number)
    _, output = process.communicate(timeout=PATIENCE)
    assert process.returncode == INTERRUPTED, output
    assert "interrupted: 0 of 1 cases are in" in output.splitlines()[-1]
    assert "Traceback" not in output


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
