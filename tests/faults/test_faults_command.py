"""`winding faults` finds its campaign, and judges seconds only where the computer had time."""

import io
from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

from winding_cli.app import app
from winding_verification.commands import faults
from winding_verification.faults import campaign
from winding_verification.faults.outcome import Outcome

LATE = {"fault": "late", "outcome": "the run went on", "detected_after": 2.0, "detect_within": 1.0}


def printed(*outcomes: Outcome) -> str:
    console = Console(file=io.StringIO(), width=200)
    campaign.show(list(outcomes), console)
    return " ".join(console.file.getvalue().split())


def test_without_the_tests_of_a_checkout_it_refuses(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(faults, "_CAMPAIGN", tmp_path)
    result = CliRunner().invoke(app, ["faults"])
    assert result.exit_code == 2
    (sentence,) = result.stderr.splitlines()
    assert str(tmp_path) in sentence


def test_a_row_that_the_table_does_not_have_is_refused() -> None:
    result = CliRunner().invoke(app, ["faults", "--only", "earthquake"])
    assert result.exit_code == 2
    assert result.stderr == "winding: no row of the fault table contains 'earthquake'\n"


def test_rows_come_from_the_table() -> None:
    assert faults._campaign(faults._CAMPAIGN).row_names() == campaign.row_names()
    assert len(set(campaign.row_names())) == len(campaign.row_names()) > 20


def test_seconds_are_judged_where_the_computer_had_time() -> None:
    outcome = Outcome(survived=True, **LATE)
    assert not outcome.passed
    assert "too late" in printed(outcome)
    assert "was not saturated" in printed(outcome)


@pytest.mark.parametrize("busy", [{"load": 1.5}, {"idle": 0.01}])
def test_seconds_of_a_saturated_computer_are_printed_and_not_judged(busy: dict[str, float]) -> None:
    outcome = Outcome(survived=True, **LATE, **busy)
    assert outcome.passed
    assert "2.000 1" in printed(outcome).replace("│ ", "")
    assert "saturated during 1 of them" in printed(outcome)


def test_a_fault_that_is_not_survived_fails_on_any_computer() -> None:
    assert not Outcome(survived=False, load=9.0, **LATE).passed
