"""Where the wound cable lies, with bounds for the renderer: known ahead, or growing."""

import math
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import called

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

BLOCK_ANGLE = math.pi / 4.0  # Stretches of the path whose bounds are kept [rad]


class PathTable(NamedTuple):
    """A path as the kernels take it."""

    theta: FloatArray  # Ascending wound angles [rad], shape (n,)
    z: FloatArray  # Axial positions [m], shape (n,)
    lift: FloatArray  # Heights above cable that lies on the cylinder [m], shape (n,); (0,) for none
    # Index of the last angle at or before the start of each block, and one after the end of the
    # last one, shape (blocks + 1,).
    first: IndexArray
    lowest: FloatArray  # Least z of each block [m], shape (blocks,)
    highest: FloatArray  # Greatest z of each block [m], shape (blocks,)


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

    Raises:
        ValueError: The arrays differ in shape, theta does not ascend, z is not finite or a lift is
            negative.
    """

    theta: FloatArray  # Ascending wound angles behind P0 [rad], shape (n,), n at least 2
    z: FloatArray  # Axial positions there [m], shape (n,)
    # How far the centre line lies outside that of cable on the cylinder [m], shape (n,): of turns
    # that climb on others; None for cable that all lies on the cylinder.
    lift: FloatArray | None = None
    # Both with the bounds of blocks of turns, for the renderer.
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


_AHEAD = 0.02  # The lay goes on by so much beyond the contact line, for its direction there [rad]
_CLOSE = 1.0e-4  # Nearer to the last point than this a line through both is undetermined [rad]


class GrowingPath:
    """Axial position and height of the cable wound so far, piecewise linear in the wound angle.

    It belongs to one thread. Beyond its ends it is level, as a `CablePath`.

    Attributes:
        table: Its points with the bounds of blocks, for the renderer.
    """

    def __init__(self, *, lifted: bool = False) -> None:
        # Rows: wound angle [rad], axial position [m], lift [m].
        self._points = np.empty((3, 0))
        self._lifted = lifted

    def grow(
        self, kept: int, theta: FloatArray, z: FloatArray, lift: FloatArray | None = None
    ) -> None:
        """Forget the points after the first so many, and go on with others.

        Args:
            kept: How many points stay.
            theta: Wound angles of those that follow, ascending [rad], shape (n,).
            z: Axial positions there [m], shape (n,).
            lift: Heights above cable on the cylinder there [m], shape (n,); None for none.

        Raises:
            ValueError: There are not so many points.
        """
        count = self._points.shape[1]
        if not 0 <= kept <= count:
            raise ValueError(f"a path of {count} points cannot keep {kept}")
        if kept < count or theta.size:
            following = np.stack([theta, z, np.zeros_like(z) if lift is None else lift])
            self._points = np.hstack([self._points[:, :kept], following])

    def end(self, theta: float, z: float, slope: float, lift: float = 0.0) -> None:
        """Have it end at the contact line, in place of where it ended before.

        Args:
            theta: Wound angle there, at or after the last point [rad].
            z: Axial position there [m].
            slope: Rise there, dz/dtheta [m/rad].
            lift: Height above cable on the cylinder there [m].
        """
        if not self._points.size:
            self.grow(0, np.array([theta]), np.array([z]))
        last_theta, last_z, _ = self._points[:, -1].tolist()
        if theta - last_theta > _CLOSE:
            # One line from the last point through the contact line.
            slope = (z - last_z) / (theta - last_theta)
        ahead = [[theta + _AHEAD], [z + _AHEAD * slope], [lift]]
        points = np.hstack([self._points, ahead])
        points.flags.writeable = False
        self.table = _table(points[0], points[1], points[2] if self._lifted else points[2, :0])

    def height(self, theta: FloatArray) -> FloatArray:
        """Return z [m] at wound angles [rad], of their shape; nan for nan."""
        return np.asarray(np.interp(theta, self.table.theta, self.table.z), dtype=float)

    def lifted(self, theta: FloatArray) -> FloatArray:
        """Return the lift [m] at wound angles [rad], of their shape."""
        if not self._lifted:
            return np.zeros(np.shape(theta))
        return np.asarray(np.interp(theta, self.table.theta, self.table.lift), dtype=float)
