"""The state of the driver in one sentence with its counts."""

from __future__ import annotations

from collections.abc import Mapping

from winding_core.status import Level, Status
from winding_plc_driver.machine.joining import Joiner
from winding_plc_driver.machine.mapping import State
from winding_plc_driver.machine.reading import VariableReader
from winding_plc_driver.machine.sequence import SequenceNumbers

NAME = "winding_rig: PLC"


def machine_state(state: State, value: object) -> tuple[str, bool]:
    """Return (the machine's state in words, whether it is a fault)."""
    words = state.names.get(value) if isinstance(value, int) else None
    return words or str(value), value in state.faults


def report(
    errors: list[str],
    warnings: list[str],
    *,
    readers: Mapping[str, VariableReader],
    joiner: Joiner,
    numbers: SequenceNumbers,
    further: Mapping[str, str],
) -> Status:
    """Return the status of the driver.

    Args:
        errors: Sentences on what does not work, worst first.
        warnings: Sentences on what works and should be known.
        readers: Of every number.
        joiner: Of the axes.
        numbers: Of the notifications.
        further: What else is to be shown.
    """
    counts = joiner.counts
    overflows = sum(reader.overflows for reader in readers.values())
    errors = [*errors, *(reader.complaint for reader in readers.values() if reader.complaint)]
    if numbers.gaps or overflows or counts.late:
        warnings = [
            *warnings,
            f"lost so far: {numbers.gaps} notifications, {overflows} times values from a full "
            f"queue, {counts.late} values that came too late",
        ]
    level = Level.ERROR if errors else Level.WARN if warnings else Level.OK
    values = dict(further)
    for name, reader in readers.items():
        values[f"{name} taken"] = str(reader.taken)
        values[f"{name} repeated"] = str(reader.repeated)
        values[f"{name} unusable"] = str(reader.unusable)
    values |= {
        "samples joined": str(counts.joined),
        "samples interpolated": str(counts.interpolated),
        "samples held": str(counts.held),
        "values too late": str(counts.late),
        "values too early": str(counts.early),
        "queue overflows": str(overflows),
        "notifications missing": str(numbers.gaps),
        "notifications fetched again": str(numbers.fetched),
        "notifications repeated": str(numbers.repeated),
    }
    sentences = errors or warnings or ["the link is up"]
    return Status(name=NAME, level=level, message="; ".join(sentences), values=values)
