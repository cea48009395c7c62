"""`winding faults` has its rows, and judges seconds only where the computer had time."""

import io

import pytest
from rich.console import Console
from typer.testing import CliRunner

from winding_cli.app import app
from winding_verification.faults import campaign
from winding_verification.faults.cell_faults import SENSOR_FAULTS
from winding_verification.faults.outcome import Outcome

LATE = {"fault": "late", "outcome": "the run went on", "detected_after": 2.0, "detect_within": 1.0}


def printed(*outcomes: Outcome) -> str:
    console = Console(file=io.StringIO(), width=200)
    campaign.show(list(outcomes), console)
    return " ".join(console.file.getvalue().split())


def test_a_row_that_the_table_does_not_have_is_refused() -> None:
    result = CliRunner().invoke(app, ["faults", "--only", "earthquake"])
    assert result.exit_code == 2
    assert result.stderr == "winding: no row of the fault table contains 'earthquake'\n"


def test_rows_have_names_of_their_own() -> None:
    assert len(set(campaign.row_names())) == len(campaign.row_names()) > 20
    assert all(fault.noticed and fault.within > 0.0 for fault in SENSOR_FAULTS)
    assert len(SENSOR_FAULTS) == 14


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
