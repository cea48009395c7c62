"""Where an external machine stands before its run, or why no standing machine is seen."""

import asyncio
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node

from winding_core.machine.axes import JointSample, MachineAxes
from winding_core.machine.incoming_readings import MOTION, missing_joints
from winding_core.units import MILLIMETRE
from winding_recorder.live.run_buffer import BufferedMessage, RunBuffer
from winding_ros import topics
from winding_ros.graph import GraphError
from winding_ros.messages.rig import decode_joint_sample
from winding_ros.messages.serialised import MessageError, deserialised
from winding_supervisor.processes.discovery import RivalWatch

FloatArray = NDArray[np.float64]

_POLL = 0.02
PATIENCE = 30.0
_LOOK = 0.5  # Standing readings are looked at for so long [s]
_NAMED = 200  # So many of the newest messages show which joints a driver has
# Positions of a machine that stands tremble by less than this within a look [rad, m].
_TREMBLING = (0.01, 2.0e-4)


async def standing_axes(
    node: Node, buffer: RunBuffer, axes: MachineAxes, clock: Callable[[], float]
) -> MachineAxes:
    """Wait until a machine is heard and stands; return axes with their offsets there.

    Raises:
        GraphError: No driver is heard, its joints have other names, or the machine moves.
    """
    end = clock() + PATIENCE
    while True:
        samples = _recent(buffer, axes, clock())
        if samples is not None and at_rest(_places(samples, axes)):
            return axes.standing_at((item.cylinder, item.carriage) for item in samples)
        if clock() > end:
            raise GraphError(_why_not(node, buffer, axes, samples, clock()))
        await asyncio.sleep(_POLL)


def at_rest(places: FloatArray) -> bool:
    """Return whether angle [rad] and carriage position [m] of a look, shape (n, 2), stand.

    They may tremble, but not approach a place that counts as motion from here, as a machine does
    that is still stopping.
    """
    newer, older = (half.mean(axis=0) for half in np.array_split(places, 2))
    still = np.abs(newer - older) <= np.divide(MOTION, 2.0)
    return bool((still & (np.ptp(places, axis=0) <= _TREMBLING)).all())


def joint_sample(message: BufferedMessage, axes: MachineAxes) -> JointSample | None:
    """Return the joints of a buffered joint state; None for one that cannot be used."""
    try:
        return decode_joint_sample(deserialised(message.data, topics.JOINT_STATES.type), axes)
    except MessageError:
        return None


def _recent(buffer: RunBuffer, axes: MachineAxes, now: float) -> list[JointSample] | None:
    """Return the samples of the last look; None before they cover it."""
    found: list[JointSample] = []
    for message in reversed(buffer.messages[topics.JOINT_STATES.name]):
        sample = joint_sample(message, axes)
        if sample is None or now - message.received_ns * 1e-9 > 2.0 * _LOOK:
            return None
        found.append(sample)
        if found[0].t - sample.t >= _LOOK:
            return found
    return None


def _why_not(
    node: Node, buffer: RunBuffer, axes: MachineAxes, samples: list[JointSample] | None, now: float
) -> str:
    """Return why no standing machine was seen, as a sentence."""
    name = topics.JOINT_STATES.name
    if buffer.last(topics.JOINT_STATES) is None:
        return (
            f"no driver publishes on {node.resolve_topic_name(name)} for {PATIENCE:g} s; start it, "
            "or see `winding conform`"
        )
    heard = buffer.messages[name].newest(_NAMED)
    states = [deserialised(item.data, topics.JOINT_STATES.type) for item in heard]
    # As many periods as messages.
    took = (
        1e-9 * (heard[-1].received_ns - heard[0].received_ns) * len(heard) / max(len(heard) - 1, 1)
    )
    if missing := missing_joints(name, [tuple(state.name) for state in states], took, axes):
        return missing
    try:
        decode_joint_sample(states[-1], axes)
    except MessageError as error:
        return f"the driver's {error}"
    contested = RivalWatch(node, ()).look(now)
    if contested:
        return " ".join(contested)
    if samples is None:
        return f"{name} comes too seldom to show whether the machine stands"
    turned, moved = np.ptp(_places(samples, axes), axis=0)
    return (
        f"the machine does not stand: within {_LOOK:g} s the cylinder turned {turned:.3g} rad "
        f"and the carriage moved {moved / MILLIMETRE:.3g} mm; a run begins at a standstill"
    )


def _places(samples: list[JointSample], axes: MachineAxes) -> FloatArray:
    """Return angle [rad] and carriage position [m] of samples, shape (n, 2)."""
    return np.array([axes.positions(item.cylinder, item.carriage) for item in samples])
