from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from printed_page import PrintedWord, missing_from_paper, outside_the_margins, printed_words

from winding_core.cable.condition import Condition
from winding_core.error_verdict import PAPER_LIMIT_PCT, judge_lengths
from winding_reports.records.identity import Identity, condition_quantities
from winding_reports.records.run_record import RunRecord, WoundCable
from winding_reports.run_report.report import write_report

pytestmark = [pytest.mark.campaign, pytest.mark.slow]


@pytest.fixture(scope="module")
def record(synthetic) -> RunRecord:
    """A run with every column of the table and every section."""
    run = synthetic()
    turn = np.linspace(0.0, 8.0 * np.pi, 200)
    radius = run.case.centreline_radius
    nodes = np.column_stack([radius * np.cos(turn), -radius * np.sin(turn), 1e-3 * turn])
    rows = tuple(replace(row, h_held_out=0.9) for row in run.rows)
    lengths = judge_lengths(rows, PAPER_LIMIT_PCT, published=run.case.is_published)
    return replace(
        run,
        rows=rows,
        outcome=replace(run.outcome, lengths=lengths),
        identity=Identity(
            bags=("/a/long/path/of/recordings/of/a/cell/2026/03/01/bag",),
            weights="rod",
            weights_sha256="0123456789abcdef" * 4,
            condition=condition_quantities(Condition(case=4)),
        ),
        cable=WoundCable(
            case=run.case, nodes=nodes, strain=np.full(200, 0.1), marks={0: (0.0, 0.0)}
        ),
    )


@pytest.fixture(scope="module")
def page(record: RunRecord, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_report(record, tmp_path_factory.mktemp("report"))


@pytest.fixture(scope="module")
def words(page: Path, tmp_path_factory: pytest.TempPathFactory) -> list[PrintedWord]:
    return printed_words(page, tmp_path_factory.mktemp("paper"))


def test_every_table_cell_is_on_paper(page: Path, words: list[PrintedWord]) -> None:
    assert not missing_from_paper(page.read_text(encoding="utf-8"), words)


def test_nothing_but_page_numbers_stands_in_the_margins(words: list[PrintedWord]) -> None:
    assert outside_the_margins(words) == []


def test_first_sheet_has_verdict_identity_and_main_table(
    record: RunRecord, words: list[PrintedWord]
) -> None:
    first = " ".join(word.text for word in words if word.page == 1)
    assert first.startswith(("Good", "Not good"))
    assert record.verdict.sentence.partition(": ")[2] in first
    for text in ("held out of the training", "P4 400.00", "Mean", "This run", "Cylinder speed"):
        assert text in first
