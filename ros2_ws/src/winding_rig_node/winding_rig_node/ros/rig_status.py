"""What the rig says of itself in its diagnostics."""

from __future__ import annotations

from winding_core.status import Level, Status
from winding_rig_node.machine.machine import Machine
from winding_rig_node.machine.machine_state import Phase
from winding_rig_node.machine.pace import Pace
from winding_ros import topics


def rig_status(machine: Machine, pace: Pace, faults: str, known_lay: str) -> Status:
    """Return the machine's phase and time, and how far its readers are behind.

    Args:
        machine: The machine.
        pace: What the readers have answered.
        faults: The faults that are put in on purpose, as text.
        known_lay: Name of the lay that the camera shows whatever is commanded; empty for none.
    """
    state = machine.state
    commander = machine.commander
    unseen = ""
    if known_lay and (commander.axes or commander.brake is not None):
        unseen = f"the camera shows lay {known_lay!r}, which does not follow commands"
    level = Level.WARN if state.reason or faults or commander.refusal or unseen else Level.OK
    if state.phase in (Phase.EMERGENCY, Phase.PROTECTIVE):
        level = Level.ERROR
    values = {
        "time": f"{machine.time:.3f}",
        "phase": state.phase.value,
        "reason": state.reason,
        "slowest": pace.slowest if pace.answered else "",
    }
    # Of simulated time: what waits on the way to a reader, and in it, is not longer.
    values |= {
        f"lead over {name} [s]": f"{max(machine.time - t, 0.0):.3f}"
        for name, t in pace.answered.items()
    }
    refused = machine.plausibility.refused
    values |= {f"refused {name}": str(count) for name, count in refused.items()}
    if commander.axes:
        values["commanded"] = ", ".join(commander.axes)
    if commander.brake is not None:
        values["brake [N]"] = f"{commander.brake.wanted:.3f}"
    if commander.refused:
        values |= {"refused commands": str(commander.refused), "refusal": commander.refusal}
    if faults:
        values["faults"] = faults
    for name, moment in (("stop_began", state.stop_began), ("stood_at", state.stood_at)):
        values |= {name: f"{moment:.3f}"} if moment is not None else {}
    return Status(
        name=topics.RIG,
        level=level,
        message=": ".join(
            filter(None, (state.phase.value, state.reason or commander.refusal or unseen))
        ),
        values=values,
    )
