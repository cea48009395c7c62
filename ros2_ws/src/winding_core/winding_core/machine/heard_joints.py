"""Why joint states that arrive are not a machine's, in one sentence."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from winding_core.machine.axes import MachineAxes


def missing_joints(
    topic: str, names: Sequence[Collection[str]], seconds: float, axes: MachineAxes
) -> str:
    """Return what arrives where no message has both joints of a machine, or nothing.

    Args:
        topic: Where they arrive.
        names: Joints of each message.
        seconds: In how long they have arrived [s].
        axes: The machine's joints.
    """
    wanted = (axes.cylinder_joint, axes.carriage_joint)
    if not names or any(all(joint in heard for joint in wanted) for heard in names):
        return ""
    found = sorted({name for heard in names for name in heard})
    joints = f"joint{'s' * (len(found) != 1)} {', '.join(found)}" if found else "no joints"
    apart = len(found) > 1 and all(len(heard) == 1 for heard in names)
    what = (
        f"{len(names) / max(seconds, 1.0e-3):.0f} messages/s arrive on {topic} with {joints}"
        f"{', one in each' * apart}"
    )
    if set(wanted) <= set(found):
        return f"{what}; each message needs both {wanted[0]} and {wanted[1]}"
    return (
        f"{what}; configured are {wanted[0]} and {wanted[1]}: --cylinder-joint and "
        "--carriage-joint name others" + "; each message needs both" * apart
    )
