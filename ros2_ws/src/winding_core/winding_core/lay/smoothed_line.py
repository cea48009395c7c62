"""Straight pieces whose corners and steps are rounded by a cubic B-spline.

A symmetric kernel leaves straight lines as they are, so a helix stays where it is wanted and only
its corners are rounded: a corner of slope change b by at most 7/30 b h (h the spacing of the
kernel's knots, it reaches 2 h to either side). Everything up to the third derivative is finite and
known in closed form.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from winding_core.lay.program import LayProgram

Array = NDArray[np.float64]

PEAK = 7.0 / 30.0  # Rounding of a corner, per slope change and width
REACH = 2.0  # The kernel reaches so many widths to either side
_BATCH = 2_000_000  # Corners are summed in batches of so many pairs, which bounds the memory


@dataclass(frozen=True, kw_only=True)
class SmoothedLine:
    """A function of the wound angle: straight pieces with corners and steps, rounded."""

    theta: Array  # Of corners and steps, ascending [rad], shape (n,)
    bends: Array  # Change of slope there [m/rad], shape (n,)
    steps: Array  # Change of value there [m], shape (n,)
    value: float  # At 0 on the first piece [m]
    slope: float  # Of the first piece [m/rad]
    width: float  # h of the kernel [rad]; 0 for no rounding
    _slopes: Array = field(init=False, repr=False)
    _starts: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        slopes = self.slope + np.concatenate([[0.0], np.cumsum(self.bends)])
        # Value that piece k would have at its first point; the first piece at 0.
        gaps = np.diff(self.theta, prepend=0.0)
        rises = slopes[:-1] * gaps + self.steps
        starts = self.value + np.concatenate([[0.0], np.cumsum(rises)])
        object.__setattr__(self, "_slopes", slopes)
        object.__setattr__(self, "_starts", starts)

    def at(self, theta: ArrayLike, order: int = 0) -> Array:
        """Return a derivative of the rounded line at wound angles [rad].

        Args:
            theta: Wound angles [rad], any shape.
            order: 0 for the value [m] to 3 [m/rad^3].
        """
        theta = np.asarray(theta, dtype=float)
        flat = theta.ravel()
        values = self.unrounded(flat, order)
        if self.width > 0.0 and self.theta.size:
            values = values + self._rounding(flat, order)
        return np.asarray(values.reshape(theta.shape))

    def unrounded(self, theta: Array, order: int = 0) -> Array:
        """Return value [m] or slope [m/rad] of the straight pieces, shape (m,); else zeros."""
        piece = np.searchsorted(self.theta, theta, side="right")
        if order == 0:
            origins = np.concatenate([[0.0], self.theta])
            return np.asarray(self._starts[piece] + self._slopes[piece] * (theta - origins[piece]))
        return self._slopes[piece] if order == 1 else np.zeros(theta.shape)

    def rounded_by(self) -> Array:
        """Return by how much each corner's own point is off the straight pieces [m], shape (n,)."""
        if self.width == 0.0 or not self.theta.size:
            return np.zeros(self.theta.shape)
        return self._rounding(self.theta, 0)

    def _rounding(self, theta: Array, order: int) -> Array:
        reach = REACH * self.width
        first = np.searchsorted(self.theta, theta - reach, side="left")
        counts = np.searchsorted(self.theta, theta + reach, side="right") - first
        if int(counts.sum()) > _BATCH and theta.size > 1:
            middle = theta.size // 2
            return np.concatenate(
                [self._rounding(theta[:middle], order), self._rounding(theta[middle:], order)]
            )
        point = np.repeat(np.arange(theta.size), counts)
        before = np.repeat(np.cumsum(counts) - counts, counts)
        corner = np.arange(point.size) - before + np.repeat(first, counts)
        x = theta[point] - self.theta[corner]
        parts = self.bends[corner] * _kernel(x, self.width, order)
        if self.steps.any():
            parts = parts + self.steps[corner] * _kernel(x, self.width, order + 1)
        return np.bincount(point, weights=parts, minlength=theta.size).astype(float)


def _kernel(x: Array, width: float, order: int) -> Array:
    """Return a derivative of the rounding of a unit corner at x [rad] from it.

    Order 2 is the kernel itself. Odd orders are odd; at the corner that after it counts.
    """
    u = np.minimum(np.abs(x) / width, REACH)
    v = REACH - u
    if order == 0:
        inner = PEAK - u / 2.0 + u**2 / 3.0 - u**4 / 12.0 + u**5 / 40.0
        outer = v**5 / 120.0
    elif order == 1:
        inner, outer = -0.5 + 2.0 * u / 3.0 - u**3 / 3.0 + u**4 / 8.0, -(v**4) / 24.0
    elif order == 2:
        inner, outer = 2.0 / 3.0 - u**2 + 0.5 * u**3, v**3 / 6.0
    elif order == 3:
        inner, outer = -2.0 * u + 1.5 * u**2, -0.5 * v**2
    else:
        inner, outer = -2.0 + 3.0 * u, v
    sign = np.where(x < 0.0, -1.0, 1.0) if order % 2 else 1.0
    return np.asarray(sign * np.where(u < 1.0, inner, outer) * width ** (1 - order))


def smoothed_program(program: LayProgram, width: float) -> SmoothedLine:
    """Return the wanted z [m] of a program over the wound angle, rounded by a width [rad]."""
    slopes = np.diff(program.z) / np.diff(program.theta)
    bends = np.diff(slopes)
    corners = program.theta[1:-1]
    bent = bends != 0.0
    return SmoothedLine(
        theta=corners[bent],
        bends=bends[bent],
        steps=np.zeros(int(bent.sum())),
        value=float(program.z[0]),
        slope=float(slopes[0]),
        width=width,
    )
