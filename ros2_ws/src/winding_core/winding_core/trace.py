"""Instants on the way of a corrected length, as each node notes them: one dtype for all."""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray


class TraceEvent(IntEnum):
    """What a record is about.

    EXPOSED: A frame, from the instant that it shows until its pixels are there, or until the
        tracker has measured it that knows the camera's clock.
    TAKEN: A message, by a node that hears it; from the beginning of its callback to the end.
    PUBLISHED: A message, by its publisher; from the call of `publish` to its return.
    """

    EXPOSED = 0
    TAKEN = 1
    PUBLISHED = 2


class Channel(IntEnum):
    """Kinds of messages that a corrected length goes back to."""

    FRAME = 0
    JOINT_STATES = 1
    TRACKED = 2
    PREDICTED = 3
    CORRECTED = 4


class Station(IntEnum):
    """Nodes that they pass."""

    RIG = 0
    SOLVER = 1
    TRACKER = 2
    CORRECTION = 3


# Instants are seconds since 1970 on the clock of the node's computer, as DDS stamps them. `stamp`
# is the message's own; `sent` and `arrived` are those of DDS for a message that was taken, else 0.
TRACE_DTYPE = np.dtype(
    [
        ("event", "<u4"),
        ("channel", "<u4"),
        ("station", "<u4"),
        ("stamp", "<f8"),
        ("sent", "<f8"),
        ("arrived", "<f8"),
        ("began", "<f8"),
        ("ended", "<f8"),
    ],
    align=True,
)
# Who stamps by the clock of the system does it less than this before a message is dealt with [s].
STAMPED_BY_CLOCK = 5.0
_KINDS: dict[str, type[IntEnum]] = {"event": TraceEvent, "channel": Channel, "station": Station}


def usable_records(records: NDArray[np.void]) -> NDArray[np.bool_]:
    """Return which records bear known kinds and times that are finite, shape (n,).

    Args:
        records: TRACE_DTYPE, shape (n,).
    """
    usable = np.ones(len(records), dtype=bool)
    for name in TRACE_DTYPE.names or ():
        if name in _KINDS:
            usable &= records[name] < len(_KINDS[name])
        else:
            usable &= np.isfinite(records[name])
    return usable
