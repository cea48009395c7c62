"""Where the wound cable lies: axial position over wound angle, checked once, with its bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import called

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

# Stretches of the path whose bounds are kept [rad].
BLOCK_ANGLE = math.pi / 4.0


class PathTable(NamedTuple):
    """A path as the kernels take it.

    Attributes:
        theta: Ascending wound angles [rad], shape (n,).
        z: Axial positions [m], shape (n,).
        lift: Heights above cable that lies on the cylinder [m], shape (n,); (0,) for none.
        first: Index of the last angle at or before the start of each block, and one after the
            end of the last one, shape (blocks + 1,).
        lowest: Least z of each block [m], shape (blocks,).
        highest: Greatest z of each block [m], shape (blocks,).
    """

    theta: FloatArray
    z: FloatArray
    lift: FloatArray
    first: IndexArray
    lowest: FloatArray
    highest: FloatArray


class WoundPath(Protocol):
    """Where wound cable lies, as a scene needs it."""

    @property
    def table(self) -> PathTable:
        """The path with the bounds of blocks of turns, for the renderer."""
        ...

    def height(self, theta: FloatArray) -> FloatArray:
        """Return z [m] at wound angles [rad], of their shape; nan for nan."""
        ...

    def lifted(self, theta: FloatArray) -> FloatArray:
        """Return the lift [m] at wound angles [rad], of their shape."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class CablePath:
    """Axial position and height of the wound cable, piecewise linear in the wound angle.

    Beyond its ends it is level.

    The arrays are copied and cannot be written: what is checked here holds for every scene.

    Attributes:
        theta: Ascending wound angles behind P0 [rad], shape (n,), n at least 2.
        z: Axial positions there [m], shape (n,).
        lift: How far the centre line lies outside that of cable on the cylinder [m], shape (n,):
            of turns that climb on others; None for cable that all lies on the cylinder.
        table: Both with the bounds of blocks of turns, for the renderer.

    Raises:
        ValueError: The arrays differ in shape, theta does not ascend, z is not finite or a lift is
            negative.
    """

    theta: FloatArray
    z: FloatArray
    lift: FloatArray | None = None
    table: PathTable = field(init=False, repr=False)

    def __post_init__(self) -> None:
        theta, z = _fixed(self.theta), _fixed(self.z)
        if theta.ndim != 1 or theta.shape != z.shape or theta.size < 2:
            raise ValueError(
                "theta and z of a path must be two arrays of one length of at least 2, got "
                f"{theta.shape} and {z.shape}"
            )
        if not (np.isfinite(z).all() and np.isfinite(theta).all() and (np.diff(theta) > 0).all()):
            raise ValueError("theta of a path must ascend and z must be finite")
        lift = np.zeros(0) if self.lift is None else _fixed(self.lift)
        if self.lift is not None and (lift.shape != theta.shape or not (lift >= 0.0).all()):
            raise ValueError("lift of a path must be an array of its length, nowhere negative")
        object.__setattr__(self, "theta", theta)
        object.__setattr__(self, "z", z)
        object.__setattr__(self, "table", _table(theta, z, lift))

    def height(self, theta: FloatArray) -> FloatArray:
        """Return z [m] at wound angles [rad], of their shape; nan for nan."""
        return np.asarray(np.interp(theta, self.theta, self.z), dtype=float)

    def lifted(self, theta: FloatArray) -> FloatArray:
        """Return the lift [m] at wound angles [rad], of their shape."""
        if self.lift is None:
            return np.zeros(np.shape(theta))
        return np.asarray(np.interp(theta, self.theta, self.table.lift), dtype=float)


def _fixed(values: FloatArray) -> FloatArray:
    copy = np.array(values, dtype=float, order="C")
    copy.flags.writeable = False
    return copy


def _table(theta: FloatArray, z: FloatArray, lift: FloatArray) -> PathTable:
    blocks = max(math.ceil((theta[-1] - theta[0]) / BLOCK_ANGLE), 1)
    starts = theta[0] + BLOCK_ANGLE * np.arange(blocks)
    # The point after the next block's first is one that the block's own end lies before.
    first = np.append(np.searchsorted(theta, starts, side="right") - 1, theta.size - 1)
    after = np.minimum(first[1:] + 1, theta.size - 1)
    lowest = np.minimum.reduceat(z, first[:-1])
    highest = np.maximum.reduceat(z, first[:-1])
    for end in (first[1:], after):
        lowest, highest = np.minimum(lowest, z[end]), np.maximum(highest, z[end])
    return PathTable(theta, z, lift, first.astype(np.int64), lowest, highest)


@called
def path_height(
    theta: FloatArray, z: FloatArray, lift: FloatArray, first: IndexArray, at: float
) -> tuple[float, float, float]:  # pragma: no cover
    """Return z [m], dz/dtheta [m/rad] and lift [m] at a wound angle [rad]; see `PathTable`."""
    last = theta.size - 1
    if at <= theta[0]:
        return z[0], 0.0, lift[0] if lift.size else 0.0
    if at >= theta[last]:
        return z[last], 0.0, lift[last] if lift.size else 0.0
    block = min(int((at - theta[0]) / BLOCK_ANGLE), first.size - 2)
    low, high = first[block], min(first[block + 1] + 1, last)
    while high - low > 1:
        middle = (low + high) // 2
        if theta[middle] <= at:
            low = middle
        else:
            high = middle
    slope = (z[high] - z[low]) / (theta[high] - theta[low])
    raised = 0.0
    if lift.size:
        share = (at - theta[low]) / (theta[high] - theta[low])
        raised = lift[low] + share * (lift[high] - lift[low])
    return z[low] + slope * (at - theta[low]), slope, raised


@called
def path_crosses(
    path: PathTable, start: float, end: float, low: float, high: float
) -> bool:  # pragma: no cover
    """Return whether the path may come between two heights [m] within two wound angles [rad]."""
    last = path.lowest.size - 1
    one = min(max(int((start - path.theta[0]) / BLOCK_ANGLE), 0), last)
    other = min(max(int((end - path.theta[0]) / BLOCK_ANGLE), 0), last)
    for block in range(one, other + 1):
        if path.lowest[block] <= high and path.highest[block] >= low:
            return True
    return False
