"""A lay program: where the cable is wanted on the cylinder, and under which tension."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class LayProgramError(ValueError):
    """A lay program cannot be used; the sentence names what and its limit."""


@dataclass(frozen=True, kw_only=True)
class LayProgram:
    """What is wanted of a lay, over the wound angle behind P0.

    Between its points the cable is wanted on straight lines of z over the wound angle, that is
    on helices. A dwell is an angle in which z stays; at a reversal z turns back.
    """

    theta: Array  # Wound angles, strictly ascending from 0 [rad], shape (n,), n >= 2.
    z: Array  # Axial position there [m], shape (n,); 0 at P0.
    # Pull at the guide from this point on [N], shape (n,); nan where the condition's weight pulls.
    tension: Array = field(default_factory=lambda: np.empty(0))
    # Height of the centre line above that of cable on the bare cylinder, from this point on [m],
    # shape (n,); 0 where none is below.
    raised: Array = field(default_factory=lambda: np.empty(0))
    # Wound angle at which marker n is wanted to land [rad], by n; ascending.
    markers: Mapping[int, float] = field(default_factory=dict)
    name: str = "lay program"  # As reports write it.
    remarks: tuple[str, ...] = ()  # What its reader has to say of it, a sentence each.

    def __post_init__(self) -> None:
        theta = np.asarray(self.theta, dtype=float)
        z = np.asarray(self.z, dtype=float)
        tension = np.asarray(self.tension, dtype=float)
        if tension.size == 0:
            tension = np.full(theta.shape, np.nan)
        raised = np.asarray(self.raised, dtype=float)
        if raised.size == 0:
            raised = np.zeros(theta.shape)
        given = {"theta": theta, "z": z, "tension": tension, "raised": raised}
        for name, values in given.items():
            object.__setattr__(self, name, values)
        self._check()

    def _check(self) -> None:
        if self.theta.ndim != 1 or self.theta.size < 2:
            raise LayProgramError(f"a lay program needs two points or more, got {self.theta.size}")
        if not self.theta.shape == self.z.shape == self.tension.shape == self.raised.shape:
            raise LayProgramError(
                f"theta, z, tension and raised must be of one length, got {self.theta.size}, "
                f"{self.z.size}, {self.tension.size} and {self.raised.size}"
            )
        if not (np.isfinite(self.theta).all() and np.isfinite(self.z).all()):
            raise LayProgramError("the points of a lay program must be finite")
        if self.theta[0] != 0.0 or self.z[0] != 0.0:
            raise LayProgramError(
                "a lay program begins at P0, at 0 rad and 0 mm, "
                f"got {self.theta[0]:g} rad and {1e3 * self.z[0]:g} mm"
            )
        steps = np.diff(self.theta)
        if (steps <= 0.0).any():
            worst = int(np.argmin(steps)) + 1
            raise LayProgramError(
                f"wound angles must ascend, point {worst + 1} is at {self.theta[worst]:g} rad "
                f"after {self.theta[worst - 1]:g} rad"
            )
        if (self.tension < 0.0).any():
            raise LayProgramError(
                f"tension must not be negative, got {np.nanmin(self.tension):g} N"
            )
        if not (self.raised >= 0.0).all():
            raise LayProgramError(
                f"raised must not be negative, no cable lies in the cylinder, "
                f"got {1e3 * self.raised.min():g} mm"
            )
        self._check_markers()

    def _check_markers(self) -> None:
        before = 0.0
        for number in sorted(self.markers):
            angle = self.markers[number]
            if number < 1:
                raise LayProgramError(f"markers are numbered from 1 on, got {number}")
            if not before < angle <= self.end:
                raise LayProgramError(
                    f"marker {number} must land after {before:g} rad and by the end at "
                    f"{self.end:g} rad, got {angle:g} rad"
                )
            before = angle

    @property
    def end(self) -> float:
        """Wound angle at which the program ends [rad]."""
        return float(self.theta[-1])

    def z_at(self, theta: ArrayLike) -> Array:
        """Return the wanted axial position [m] at wound angles [rad], same shape.

        Before P0 and after the end the first and the last helix go on.
        """
        theta = np.asarray(theta, dtype=float)
        k = self._piece(theta)
        return np.asarray(self.z[k] + self._slopes[k] * (theta - self.theta[k]))

    def slope_at(self, theta: ArrayLike) -> Array:
        """Return dz/dtheta [m/rad] at wound angles [rad], same shape; at a point that after it."""
        return np.asarray(self._slopes[self._piece(np.asarray(theta, dtype=float))])

    def tension_at(self, theta: ArrayLike) -> Array:
        """Return the wanted pull [N] at wound angles [rad], same shape; nan where none is given."""
        theta = np.asarray(theta, dtype=float)
        k = np.clip(np.searchsorted(self.theta, theta, side="right") - 1, 0, self.theta.size - 1)
        return np.asarray(self.tension[k])

    def raised_at(self, theta: ArrayLike) -> Array:
        """Return the height above cable on the bare cylinder [m] at wound angles [rad]."""
        return np.asarray(self.raised[self._piece(np.asarray(theta, dtype=float))])

    @property
    def layered(self) -> bool:
        """Whether cable is wanted on cable."""
        return bool((self.raised > 0.0).any())

    @property
    def _slopes(self) -> Array:
        return np.asarray(np.diff(self.z) / np.diff(self.theta))

    def _piece(self, theta: Array) -> NDArray[np.intp]:
        found = np.searchsorted(self.theta, theta, side="right") - 1
        return np.asarray(np.clip(found, 0, self.theta.size - 2))
