"""The judgement of runs with faults: what a run leaves against what an observer saw of it."""

import asyncio
import copy
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from winding_cli.app import app
from winding_verification.faults.campaign import ROWS, Outcome, Row, draw_plans, judge, try_rows
from winding_verification.faults.judgement import disagreements
from winding_verification.faults.trial import Account, Fault, Plan, Trial

HEADLINE = "ended by supervision after 0.61 of 1.38 turns: cable_fem ended with exit code -9"


def account(**changed: Any) -> Account:
    """Return the account of a foreign machine whose run ended as its solver was killed."""
    outcome = {
        "verdict": "failed",
        "ended_by": "supervision",
        "cause": {"source": "cable_fem", "text": "cable_fem ended with exit code -9"},
        "machine": "standing",
        "asked": {"turns": 1.38},
        "done": {"turns": 0.61},
        "sentences": [HEADLINE],
        "losses": [],
    }
    seen = {
        "motion": "standing",
        "last_motion": "standing",
        "turns": 0.66,
        "farthest": 0.66,
        "moved": 100.0,
        "notes": [
            {"what": "kill cable_fem", "at": 102.5, "turns": 0.58},
            {"what": "ended", "at": 109.0, "turns": 0.66},
        ],
    }
    whole = Account(code=1, printed=HEADLINE, run={"outcome": outcome}, seen=seen)
    for place, value in changed.items():
        if place in outcome:
            outcome[place] = value
        elif place in seen:
            seen[place] = value
        else:
            setattr(whole, place, value)
    return whole


PLAN = Plan(name="1.1", faults=(Fault(at=2.5, what="kill cable_fem"),), foreign=True)


def test_a_run_that_is_written_down_as_it_was_seen_agrees() -> None:
    assert disagreements(PLAN, account()) == []


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"code": None}, "it hung"),
        ({"orphans": ["python -m correction_node"]}, "left behind: python -m correction_node"),
        ({"printed": f"{HEADLINE}\nTraceback (most"}, "it printed a traceback"),
        ({"printed": ""}, f"not on the terminal: {HEADLINE}"),
        ({"code": 0}, "verdict failed and exit code 0"),
        ({"code": 130}, "verdict failed and exit code 130"),
        ({"run": None, "code": 1, "printed": ""}, "there is no run.json of what was wound"),
        ({"motion": "turning"}, "written down as standing and seen turning"),
        ({"motion": "unknown"}, "written down as standing and seen unknown"),
        ({"machine": "turning"}, "written down as turning and seen standing"),
        ({"done": {"turns": 0.75}}, "0.750 turns are written down and 0.660 were seen"),
        ({"done": {"turns": 0.41}}, "0.410 turns are written down and at least 0.580 were seen"),
        ({"cause": {"source": "correction", "text": "correction hangs"}}, "none that was put in"),
        ({"ended_by": "operator"}, "the first cause is none that was put in: operator"),
        (
            {"verdict": "good", "ended_by": "completed", "cause": None, "code": 0},
            "good although 0.660 of 1.380 turns were seen",
        ),
    ],
)
def test_what_was_not_seen_is_a_disagreement(changed: dict[str, Any], sentence: str) -> None:
    assert any(sentence in found for found in disagreements(PLAN, account(**changed)))


@pytest.mark.parametrize("what", ["machine jumps", "role rogue", "signal TERM", "kill driver"])
def test_a_fault_that_ends_runs_is_not_passed_over(what: str) -> None:
    notes = [
        {"what": what, "at": 102.0, "turns": 0.4},
        {"what": "ended", "at": 109.0, "turns": 1.4},
    ]
    over = account(
        verdict="not judged", ended_by="completed", cause=None, code=0, notes=notes,
        turns=1.4, farthest=1.4, done={"turns": 1.39},
    )  # fmt: skip
    assert disagreements(PLAN, over) == [f"{what!r} is in no cause and no loss"]
    late = copy.deepcopy(over)
    late.seen["notes"][0] |= {"at": 108.9, "turns": 1.37}
    assert disagreements(PLAN, late) == []


@pytest.mark.parametrize(
    ("signals", "excused"), [(["TERM"], 0), (["TERM", "INT"], 1), (["INT INT"], 1)]
)
def test_a_second_signal_asks_for_haste(signals: list[str], excused: int) -> None:
    notes = [{"what": f"signal {names}", "at": 103.0, "turns": 0.5} for names in signals]
    notes.append({"what": "ended", "at": 109.0, "turns": 0.66})
    found = disagreements(PLAN, account(run=None, code=130, notes=notes))
    assert found == ([] if excused else ["there is no run.json of what was wound"])


@pytest.mark.parametrize(("names", "agrees"), [("INT", False), ("INT TERM", True)])
def test_haste_shows_in_the_exit_code_of_whatever_ends(names: str, agrees: bool) -> None:
    whole = account(code=130)
    whole.seen["notes"].insert(1, {"what": f"signal {names}", "at": 103.0, "turns": 0.6})
    assert (disagreements(PLAN, whole) == []) is agrees


@pytest.mark.parametrize(
    ("what", "last", "agrees"),
    [
        ("hold driver", "standing", True),
        ("kill driver", "turning", False),
        ("kill correction", "standing", False),
    ],
)
def test_a_machine_may_be_silenced_once_seen_standing(what: str, last: str, agrees: bool) -> None:
    whole = account(motion="unknown", last_motion=last)
    whole.seen["notes"].insert(1, {"what": what, "at": 103.0, "turns": 0.66})
    assert (disagreements(PLAN, whole) == []) is agrees


def row(**changed: Any) -> Row:
    expected: dict[str, Any] = {
        "ended_by": "supervision",
        "source": "cable_fem",
        "machine": "standing",
    }
    return Row(plan=PLAN, **(expected | changed))


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({}, ""),
        ({"ended_by": "completed"}, "ended by supervision instead of completed"),
        ({"source": "correction"}, "first cause of cable_fem instead of correction"),
        ({"source": ""}, "first cause of cable_fem instead of none"),
        ({"machine": "turning"}, "machine standing instead of turning"),
        ({"reported": ("exit code -9", "restarted")}, "nothing is reported of 'restarted'"),
        # It was never detected: no second is left out of the judgement.
        ({"within": 0.3}, "detected after - instead of 0.3 s"),
    ],
)
def test_a_row_states_how_its_run_comes_out(changed: dict[str, Any], sentence: str) -> None:
    outcome = judge(row(**changed), account())
    assert outcome.passed == (not sentence)
    assert outcome.passed or sentence in outcome.disagreements


def test_a_seed_draws_equal_runs_with_up_to_three_faults_of_every_kind() -> None:
    plans = draw_plans(200, 11)
    assert plans == draw_plans(200, 11) != draw_plans(200, 12)
    assert {len(plan.faults) for plan in plans} == {0, 1, 2, 3}
    words = {fault.what.split()[0] for plan in plans for fault in plan.faults}
    assert words == {"kill", "hold", "machine", "role", "disk", "remove", "signal"}
    assert all(plan.foreign or "machine " not in str(plan.faults) for plan in plans)


def test_rows_have_names_of_their_own_and_state_how_they_come_out() -> None:
    assert len({row.plan.name for row in ROWS}) == len(ROWS) > 50
    left = [row.plan.name for row in ROWS if not row.ended_by]
    assert left == ["kill -9 orchestrator"]


def test_a_row_that_the_table_does_not_have_is_refused() -> None:
    result = CliRunner().invoke(app, ["faults", "--only", "earthquake"])
    assert result.exit_code == 2
    assert result.stderr == "winding: no row of the fault table contains 'earthquake'\n"


def test_a_row_that_raises_fails_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async def conduct(trial: Trial) -> Account:
        if trial.plan.name == "broken":
            raise ZeroDivisionError("of its own")
        return account()

    monkeypatch.setattr(Trial, "conduct", conduct)
    rows = [Row(plan=Plan(name="broken")), Row(plan=PLAN)]
    reported: list[Outcome] = []
    asyncio.run(try_rows(rows, tmp_path, tmp_path / "driver.py", reported.append))
    assert [outcome.passed for outcome in reported] == [False, True]
    assert reported[0].disagreements == ("the row failed: ZeroDivisionError('of its own')",)
