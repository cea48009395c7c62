"""The table of faults and the runs that a seed draws, one after the other, as `winding faults`."""

import json
import random
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from winding_core.run_outcome import EndedBy
from winding_verification.faults.judgement import disagreements
from winding_verification.faults.trial import Account, Fault, Plan, Trial

STAND_WITHIN = 0.5  # Of both axes, after the detection [s]


@dataclass(frozen=True, kw_only=True)
class Row:
    """A run with faults, and how it has to come out."""

    plan: Plan  # What is tried
    # Pattern of who ends it; empty where nothing is left to report, None where the observer judges
    ended_by: str | None = None
    source: str = ""  # Pattern of the source of the first cause; empty for none
    machine: str = "standing"  # Where the machine is left
    reported: tuple[str, ...] = ()  # Patterns of what is reported, by the run or about it
    within: float | None = None  # Limit of the time from the first fault to its detection [s]

    @property
    def expected(self) -> str:
        """How it has to come out, in words."""
        if self.ended_by is None:
            return ""
        return f"{self.ended_by or 'nothing left'}, {self.source or 'no cause'}, {self.machine}"


def _row(
    *, name: str, faults: list[str], foreign: bool = False, options: Iterable[str] = (),
    duration: float = 3.0, reported: Iterable[str] = (), **expected: object,
) -> Row:  # fmt: skip
    put_in = [Fault(at=float(at), what=what) for at, _, what in (f.partition(" ") for f in faults)]
    plan = Plan(
        name=name, faults=tuple(put_in), foreign=foreign, options=tuple(options), duration=duration
    )
    return Row(plan=plan, reported=tuple(reported), **expected)  # type: ignore[arg-type]


ROWS = tuple(
    _row(**item)
    for item in json.loads(
        files("winding_verification").joinpath("data", "faults.json").read_text("utf-8")
    )
)


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a run with faults."""

    row: Row  # What was tried
    came_out: str = ""  # Who ended it, the first cause, the machine; what the observer saw
    disagreements: tuple[str, ...]  # A sentence each
    detected_after: float | None = None  # Wall time from the first fault to its detection [s]
    stood_after: float | None = None  # Wall time from the detection to standstill [s]

    @property
    def passed(self) -> bool:
        """Whether everything agrees."""
        return not self.disagreements

    @property
    def line(self) -> str:
        """The outcome in a line, and a further one for each disagreement."""
        word = "ok    " if self.passed else "FAILED"
        seconds = ""
        if self.row.within is not None:
            seconds = f"; detected after {_seconds(self.detected_after)} ({self.row.within:g})"
            seconds += f", stood {_seconds(self.stood_after)} later ({STAND_WITHIN:g})"
        wrong = "".join(f"\n        {sentence}" for sentence in self.disagreements)
        name, put_in = self.row.plan.name, self.row.plan.put_in
        return f"{word}  {name}: {put_in} -> {self.came_out}{seconds}{wrong}"

    def as_record(self) -> dict[str, object]:
        """Return JSON values."""
        return {
            "name": self.row.plan.name,
            "put_in": self.row.plan.put_in,
            "expected": self.row.expected,
            "came_out": self.came_out,
            "disagreements": list(self.disagreements),
            "detected_after": self.detected_after,
            "detect_within": self.row.within,
            "stood_after": self.stood_after,
            "passed": self.passed,
        }


async def try_rows(
    rows: Iterable[Row], folder: Path, driver: Path, report: Callable[[Outcome], None]
) -> list[Outcome]:
    """Try runs one after the other; what raises has failed.

    Args:
        rows: Runs.
        folder: Existing folder for their files.
        driver: Of a foreign machine.
        report: Receives each outcome as soon as it is known.
    """
    outcomes = []
    for number, row in enumerate(rows, 1):
        trial = Trial(row.plan, folder / f"{number}", f"faults{number}", driver)
        try:
            outcome = judge(row, await trial.conduct())
        except Exception as error:  # noqa: BLE001 - whatever fails, the rows after it are tried
            outcome = Outcome(row=row, disagreements=(f"the row failed: {error!r}",))
        report(outcome)
        outcomes.append(outcome)
    return outcomes


def judge(row: Row, account: Account) -> Outcome:
    """Return whether a run came out as it had to, and as the observer saw it."""
    wrong = disagreements(row.plan, account)
    detected, stood = _times(account)
    if row.ended_by is not None:
        wrong += _mismatches(row, account)
        if row.within is not None and (detected is None or detected > row.within):
            wrong.append(f"detected after {_seconds(detected)} instead of {row.within:g} s")
        if stood is not None and stood > STAND_WITHIN:
            wrong.append(f"stood {_seconds(stood)} after detection instead of {STAND_WITHIN:g} s")
    came_out, seen = "no run.json", account.seen
    if account.run is not None:
        outcome = account.run["outcome"]
        cause = (outcome["cause"] or {"source": "no cause"})["source"]
        came_out = f"{outcome['verdict']}: {outcome['ended_by']}, {cause}, {outcome['machine']}"
        came_out += f", {outcome['done']['turns']:.2f} turns"
    came_out += f"; exit code {account.code}; seen {seen['motion']}, {seen['turns']:.2f} turns"
    return Outcome(
        row=row,
        came_out=came_out,
        disagreements=tuple(wrong),
        detected_after=detected,
        stood_after=stood,
    )


def _mismatches(row: Row, account: Account) -> Iterator[str]:
    """Yield where a run did not come out as its row states."""
    if account.run is None:
        if row.ended_by:
            yield "there is no run.json"
        return
    outcome = account.run["outcome"]
    source = "" if outcome["cause"] is None else outcome["cause"]["source"]
    for what, wanted, found in (
        ("ended by", row.ended_by or EndedBy.COMPLETED.value, outcome["ended_by"]),
        ("first cause of", row.source, source),
        ("machine", row.machine, outcome["machine"]),
    ):
        if not re.fullmatch(wanted, found):
            yield f"{what} {found or 'none'} instead of {wanted or 'none'}"
    events = [f"{event.what} {event.node} {event.text}" for event in account.events]
    everything = "\n".join([*outcome["sentences"], *events, *account.answers])
    for pattern in row.reported:
        if not re.search(pattern, everything):
            yield f"nothing is reported of {pattern!r}"


def _times(account: Account) -> tuple[float | None, float | None]:
    """Return wall times from fault to detection and from there to standstill [s]."""
    begun = [note["at"] for note in account.seen["notes"]]
    after = [event for event in account.events if begun and event.wall >= begun[0]]
    detected = next((event.wall for event in after if event.what == "detected"), None)
    stood = next((event.wall for event in after if event.what == "standing"), None)
    if detected is None:
        return None, None
    return detected - begun[0], None if stood is None else max(0.0, stood - detected)


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f} s"


_NODES = ("winding_rig", "cable_fem", "marker_tracker", "correction")
_FOREIGN_NODES = ("cable_fem", "correction")
_INJECTED = (
    *("load_cell:off", "load_cell:garbage", "cylinder_encoder:stuck", "cylinder_encoder:wrong:-1"),
    *("rig/tension:garbage", "rig/joint_states:garbage", "rig/joint_states:wrong:10"),
    *("camera:off", "camera:intermittent:0.2", "/clock:wrong:2"),
)
_MACHINE = (
    *("stops unanswered", "stops refused", "stops ignored", "stops early", "jumps"),
    *("goes back in time", "shifts its clock", "sends NaN"),
)
_SIGNALS = ("INT", "TERM", "INT INT", "TERM TERM", "INT TERM")
_EARLY, _START_TAKES = 0.15, 8.0  # Of the faults so many come while the nodes are started


def draw_plans(count: int, seed: int) -> list[Plan]:
    """Return so many runs, with 0 to 3 faults each; equal seeds draw equal runs."""
    draw = random.Random(seed)
    return [_plan(draw, f"{seed}.{number}") for number in range(1, count + 1)]


def _plan(draw: random.Random, name: str) -> Plan:
    foreign = draw.random() < 0.5
    duration = round(draw.uniform(2.0, 4.0), 1)
    faults = [_fault(draw, foreign, duration) for _ in range(draw.randrange(4))]
    # Faults of the start come first: those of the run wait for a motion.
    faults.sort(key=lambda fault: (fault.at >= 0.0, abs(fault.at)))
    return Plan(name=name, faults=tuple(faults), foreign=foreign, duration=duration)


def _fault(draw: random.Random, foreign: bool, duration: float) -> Fault:
    if draw.random() < _EARLY:
        at = -draw.uniform(0.1, _START_TAKES)
    else:
        at = draw.uniform(0.05, duration)
    node = draw.choice(_FOREIGN_NODES if foreign else _NODES)
    own = f"machine {draw.choice(_MACHINE)}"
    if not foreign:
        # Its parameters are there when its node is.
        own = f"role set winding_rig inject_fault {draw.choice(_INJECTED)}"
    kinds = (
        (f"kill {node}", 3),
        # A node that is held while it starts is waited for two minutes.
        (f"hold {node}", 2 if at >= 0.0 else 0),
        (f"hold {node} {draw.uniform(0.1, 2.0):.2f}", 1),
        (f"hold orchestrator {draw.uniform(0.1, 2.5):.2f}", 1),
        (own, 5 if foreign or at >= 0.0 else 0),
        (f"{draw.choice(('kill', 'hold'))} driver", 2 if foreign else 0),
        ("disk", 1),
        ("remove", 1),
        (f"role rogue {draw.choice(('', 'stamped', 'truncated'))}".strip(), 2),
        (f"signal {draw.choice(_SIGNALS)}", 2),
    )
    what = draw.choices([kind for kind, _ in kinds], [weight for _, weight in kinds])[0]
    return Fault(at=round(at, 2), what=what)
