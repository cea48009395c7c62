"""Does the outcome of a run agree with what an observer saw, and with what was put in?"""

import re
from collections.abc import Iterator, Mapping
from typing import Any

from winding_core.run_outcome import EndedBy, Motion, Verdict
from winding_verification.faults.trial import Account, Plan

# First causes that a fault may have, as `ended by | source | text`, by how the fault begins. A
# fault may also be survived; those of _ENDING may not where they had a second to be noticed.
_CAUSES: Mapping[str, str] = {
    "kill orchestrator": "",
    "kill driver": r"machine\|.*(silent|no driver|no server|no answer|moved within)",
    "kill": r"(supervision|fault)\|.*{node}",
    "hold driver": r"machine\|.*(silent|no driver|no server|no answer|moved within)",
    "hold orchestrator": r"(machine|supervision|fault)\|.*(sign of life|silent|late|no answer)",
    "hold": r"(supervision|fault|machine)\|.*({node}|silent|no new|late)",
    "machine stops early": r"machine\|.*stopped by itself",
    "machine stops": "",
    "machine": r"(machine|supervision|fault)\|.*(rig/joint_states|rig/tension|machine)",
    "role rogue": r"(supervision|machine|fault)\|.*(publishers|refused a message on rig/tension)",
    "role set winding_rig inject_fault": r"(supervision|machine|fault)\|.*",
    "role call": r"(operator|machine)\|",
    "whenever": r"supervision\|.*{node}",
    "successor": r"supervision\|.*{node}",
    "signal": r"signal\|SIG",
    "disk": "",
    "remove": r"fault\|.*(is gone|No such file)",
}
_ENDING = (
    "kill winding_rig",
    "kill driver",
    "machine stops early",
    "role rogue",
    "signal",
    "machine jumps",
    "machine sends NaN",
    "machine shifts its clock",
    "machine goes back in time",
)
_FINISHED = (Verdict.GOOD, Verdict.NOT_GOOD, Verdict.NOT_JUDGED)
# Samples are on their way to two readers, and a signal to a process [turns].
_SLACK = 0.03
_SILENCED = re.compile("(kill|hold) driver")
_NOTICED = 1.5  # Faults of the last second may come too late to be noticed [s]
_CODES = {EndedBy.SIGNAL: (1, 130)}  # Exit codes of runs that have not failed, by who ended them


def disagreements(plan: Plan, account: Account) -> list[str]:
    """Return where a run's outcome is not what was seen, a sentence each."""
    return list(_found(plan, account))


def _found(plan: Plan, account: Account) -> Iterator[str]:
    put_in = [note["what"] for note in account.seen["notes"] if note["what"] != "ended"]
    yield from (f"left behind: {name}" for name in account.orphans)
    if account.code is None:
        yield "it hung"
        return
    if "Traceback" in account.printed:
        yield "it printed a traceback"
    if account.run is None:
        yield from _without_numbers(account, put_in)
        return
    outcome = account.run["outcome"]
    verdict = Verdict(outcome["verdict"])
    yield from _motion_disagrees(plan, account, outcome)
    yield from _turns_disagree(account, outcome, verdict)
    yield from _cause_disagrees(account, outcome, put_in)
    codes = (1,) if verdict is Verdict.FAILED else _CODES.get(EndedBy(outcome["ended_by"]), (0, 1))
    # The exit code reports haste.
    if account.code not in codes and not (account.code == 130 and _signals(put_in) > 1):
        yield f"verdict {verdict} and exit code {account.code}"
    # A disk that takes no more may have cut the terminal's own words.
    for sentence in outcome["sentences"]:
        if sentence not in account.printed:
            yield f"not on the terminal: {sentence}"


def _without_numbers(account: Account, put_in: list[str]) -> Iterator[str]:
    # A second signal asks for haste; a killed command writes nothing.
    excused = _signals(put_in) > 1 or "kill orchestrator" in put_in
    moved, ended = account.seen["moved"], account.seen["notes"][-1]["at"]
    wound = moved is not None and ended - moved > _NOTICED and account.seen["turns"] > _SLACK
    if wound and not excused:
        yield "there is no run.json of what was wound"
    if account.code == 0:
        yield "exit code 0 without run.json"
    if account.code not in (0, 130, -9) and not any(
        _matches(what, f"fault|orchestrator|{line}") or _matches(what, f"machine|{line}")
        for what in put_in
        for line in account.printed.splitlines()
    ):
        yield f"no cause on the terminal: {account.printed.splitlines()[-1:]}"


def _signals(put_in: list[str]) -> int:
    return sum(len(what.split()) - 1 for what in put_in if what.startswith("signal "))


def _motion_disagrees(plan: Plan, account: Account, outcome: Mapping[str, Any]) -> Iterator[str]:
    written, seen = Motion(outcome["machine"]), Motion(account.seen["motion"])
    if not plan.foreign:
        # Its drives go with its process, and no process was left.
        if written is not Motion.STANDING:
            yield f"the simulated machine is written down as {written}"
        return
    # One that is held or dies after it has stood publishes nothing more by the last look at it.
    silenced = any(_SILENCED.match(note["what"]) for note in account.seen["notes"])
    if seen is Motion.UNKNOWN and silenced:
        seen = Motion(account.seen["last_motion"])
        seen = seen if seen is Motion.STANDING else Motion.UNKNOWN
    if written is Motion.STANDING and seen is not Motion.STANDING:
        yield f"the machine is written down as standing and seen {seen}"
    if seen is Motion.TURNING and not (account.code and "THE MACHINE" in account.printed):
        yield f"the machine turns, which {outcome['sentences']} do not say"
    if seen is Motion.STANDING and written is Motion.TURNING:
        yield "the machine is written down as turning and seen standing"


def _turns_disagree(
    account: Account, outcome: Mapping[str, Any], verdict: Verdict
) -> Iterator[str]:
    done, asked = outcome["done"]["turns"], outcome["asked"]["turns"]
    seen = account.seen
    if done > seen["farthest"] + _SLACK:
        yield f"{done:.3f} turns are written down and {seen['farthest']:.3f} were seen"
    first = min([note["turns"] for note in seen["notes"]] or [seen["turns"]])
    least = min(seen["turns"], asked if verdict in _FINISHED else first)
    if done < least - _SLACK:
        yield f"{done:.3f} turns are written down and at least {least:.3f} were seen"
    if verdict in _FINISHED and seen["farthest"] < asked - _SLACK:
        yield f"{verdict} although {seen['farthest']:.3f} of {asked:.3f} turns were seen"


def _cause_disagrees(
    account: Account, outcome: Mapping[str, Any], put_in: list[str]
) -> Iterator[str]:
    cause = outcome["cause"]
    ended = account.seen["notes"][-1]["at"]
    if cause is not None:
        text = f"{outcome['ended_by']}|{cause['source']}|{cause['text']}"
        if not any(_matches(what, text) for what in put_in):
            yield f"the first cause is none that was put in: {text}"
        return
    if EndedBy(outcome["ended_by"]) is not EndedBy.COMPLETED:
        yield f"{outcome['ended_by']} without a cause"
    moved = account.seen["moved"]
    for note in account.seen["notes"]:
        what = note["what"]
        in_time = moved is not None and moved < note["at"] < ended - _NOTICED
        # A run that was over already may be closing.
        under_way = note["turns"] < outcome["asked"]["turns"] - 4.0 * _SLACK
        if not (what.startswith(_ENDING) and in_time and under_way):
            continue
        lost = what.startswith("machine ") and any("rig/" in loss for loss in outcome["losses"])
        if not lost:
            yield f"{what!r} is in no cause and no loss"


def _matches(what: str, text: str) -> bool:
    """Return whether a cause may be that of a fault."""
    for begins, pattern in _CAUSES.items():
        if what.startswith(begins):
            nodes = "|".join(re.escape(word) for word in what.split()[1:])
            return bool(pattern and re.search(pattern.replace("{node}", f"({nodes})"), text))
    return False
