"""How a run came out: what is called good, what is called failed, and which sentence is first."""

import pytest

from winding_core.error_verdict import ErrorVerdict
from winding_core.lay.errors import LayVerdict
from winding_core.run_outcome import Cause, EndedBy, Ending, Extent, Motion, RunOutcome, Stop
from winding_reports.records.run_record import MarkerRow, judge_lengths


def lengths(*errors_pct: float | None, ended: bool = True) -> ErrorVerdict:
    """Markers that lie, a corrected length for each; None where the camera saw none."""
    rows = [
        MarkerRow(
            id=number,
            original=0.1 * number,
            s_fem=0.1 * number,
            s_corrected=0.1 * number,
            s_tracked=None if error is None else 0.1 * number * (1.0 + 0.01 * error),
        )
        for number, error in enumerate(errors_pct, start=1)
    ]
    return judge_lengths(rows, 3.1, published=False, ended=ended)


def cause(by: EndedBy, text: str = "why") -> Cause:
    return Cause(by=by, source="source", text=text, t=2.5)


KEPT = LayVerdict(tolerance=7e-4, kept=True, sentence="the lay keeps 0.7 mm")
OFF = LayVerdict(tolerance=7e-4, kept=False, sentence="the lay does not keep 0.7 mm")
UNDELIVERED = Stop(t=2.5, asked_by="session", failure="no answer from rig/stop in 0.8 s")
FAILURES = (EndedBy.SUPERVISION, EndedBy.MACHINE, EndedBy.LIMIT, EndedBy.FAULT)


@pytest.mark.parametrize(
    ("ending", "judged", "lay", "verdict"),
    [
        (Ending(), lengths(1.0, 2.0), None, "good"),
        (Ending(), lengths(1.0, 2.0), KEPT, "good"),
        (Ending(), lengths(1.0, 4.0), KEPT, "not good"),
        (Ending(), lengths(1.0, 2.0), OFF, "not good"),
        (Ending(), lengths(1.0, None), None, "not judged"),
        (Ending(), lengths(4.0, None), None, "not good"),
        (Ending(), lengths(), None, "not judged"),
        (Ending(machine=Motion.DRIVEN), lengths(1.0), None, "good"),
        (Ending(machine=Motion.TURNING), lengths(1.0), KEPT, "failed"),
        (Ending(machine=Motion.UNKNOWN), lengths(1.0), KEPT, "failed"),
        (Ending(cause=cause(EndedBy.OPERATOR)), lengths(1.0, ended=False), KEPT, "incomplete"),
        (Ending(cause=cause(EndedBy.SIGNAL)), lengths(4.0, ended=False), None, "incomplete"),
        *((Ending(cause=cause(by)), lengths(1.0, ended=False), KEPT, "failed") for by in FAILURES),
    ],
)
def test_good_is_only_what_is_whole_and_keeps_every_limit(ending, judged, lay, verdict) -> None:
    outcome = RunOutcome(asked=Extent(), done=Extent(), ending=ending, lengths=judged, lay=lay)
    assert outcome.verdict.value == verdict
    assert (outcome.verdict.style == "kept") == (verdict == "good")
    assert (verdict == "good") <= all("good:" in text for text in outcome.sentences[1:2])


def test_a_broken_off_run_is_not_called_good_by_its_lengths_either() -> None:
    assert lengths(1.0, ended=False).good is None
    assert lengths(1.0, ended=False).sentence.startswith("incomplete: ")
    assert lengths(4.0, ended=False).good is False


def test_a_machine_that_may_turn_comes_before_everything_else() -> None:
    outcome = RunOutcome(
        asked=Extent(turns=6.3, time=23.0, markers=5),
        done=Extent(turns=1.17, time=4.6, markers=1),
        ending=Ending(
            cause=cause(EndedBy.SUPERVISION, "marker_tracker ended with exit code -9"),
            machine=Motion.TURNING,
            stops=(UNDELIVERED,),
        ),
        losses=("events.jsonl is incomplete: disk full",),
        lengths=lengths(ended=False),
    )
    assert outcome.sentences[:3] == (
        "THE MACHINE still turns: no answer from rig/stop in 0.8 s",
        "ended by supervision after 1.17 of 6.30 turns, 4.60 of 23.00 s, 1 of 5 markers: "
        "marker_tracker ended with exit code -9",
        "events.jsonl is incomplete: disk full",
    )
    assert outcome.as_json()["sentences"] == list(outcome.sentences)
