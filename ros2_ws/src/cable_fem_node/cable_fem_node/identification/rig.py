"""A winding rig as an identification sees it: what pulls and guides the cable, and what it was."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.identification.tracked_run import IdentificationError

# What an estimate has, in the order of every vector and matrix.
NAMES = ("young", "free_length", "load_share", "guide_drag", "start_share", "build_up_length")
# ln of the mean landed stress over E; then free length, load share, drag, start share and where
# friction holds, each as the normal deviate of its place in its range.
COUNT = 6
_FARTHEST = 8.0


@dataclass(frozen=True, kw_only=True)
class Rigs:
    """Many rigs at once; the span's tension is (a T + d) [1 - (1 - f) exp(-s / L_c)].

    T is the tension that the run states: measured, or the dead weight's; s is the wound length.
    """

    young: FloatArray  # E of the cable [Pa], shape (n,)
    free_length: FloatArray  # Tangent span between contact line and guide [m], shape (n,)
    load_share: FloatArray  # a, share of the stated tension that reaches the cylinder, shape (n,)
    guide_drag: FloatArray  # d [N], shape (n,)
    start_share: FloatArray  # f, share of the tension at the start, shape (n,)
    build_up_length: FloatArray  # L_c [m] of wound cable, shape (n,)
    # Way from the landing point to where friction holds, over that of the rod, shape (n,) or (1,)
    held: FloatArray = field(default_factory=lambda: np.ones(1))

    def table(self) -> FloatArray:
        """Return all numbers in the order of NAMES, shape (n, 6)."""
        return np.column_stack([getattr(self, name) for name in NAMES])

    def part(self, rows: NDArray[np.intp]) -> Rigs:
        """Return some of the rigs."""
        return Rigs(
            **{name: getattr(self, name)[rows] for name in NAMES},
            held=np.broadcast_to(self.held, self.young.shape)[rows],
        )


@dataclass(frozen=True, kw_only=True)
class RigPrior:
    """What the construction of the machine and the data sheet say before a marker has landed.

    Ranges are even; two equal ends state that a number is known.

    Attributes:
        load_share: Range of a. Guide and pulleys take between a tenth and a half.
        start_share: Range of f where it does; the span may start nearly slack.
        held: Range of how far behind the landing point friction begins to hold, over how far that
            is on the rod with its elements; those of a cable have no length.
        scatter: Standard deviation of every other marker's place beyond the tracker's [m].
    """

    young_factor: float = 2.0  # E lies within this factor of the configured one two times in three
    free_length: tuple[float, float] = (0.8, 1.2)  # Range as shares of the configured free length
    load_share: tuple[float, float] = (0.5, 0.9)
    guide_drag: tuple[float, float] = (0.0, 0.3)  # Range of d [N]
    steady: float = 0.5  # Probability that the tension does not build up: f is 1
    start_share: tuple[float, float] = (0.05, 1.1)
    build_up_length: tuple[float, float] = (0.03, 0.6)  # Range of L_c [m]; even in its logarithm
    held: tuple[float, float] = (0.4, 1.1)
    fixing: float = 0.0  # Standard deviation of where P0 was fixed, along the cable [m]
    scatter: float = 0.0

    def __post_init__(self) -> None:
        for item in fields(self):
            values = np.atleast_1d(getattr(self, item.name))
            if not np.isfinite(values).all():
                raise IdentificationError(f"{item.name} must be finite, got {values.tolist()}")
            if values.size == 2 and values[0] > values[1]:
                raise IdentificationError(f"{item.name} must ascend, got {values.tolist()}")
        for name in ("free_length", "load_share", "start_share", "build_up_length", "held"):
            if not getattr(self, name)[0] > 0.0:
                raise IdentificationError(f"{name} must be positive, got {getattr(self, name)[0]}")
        for name in ("fixing", "scatter"):
            if getattr(self, name) < 0.0:
                raise IdentificationError(f"{name} must not be negative, got {getattr(self, name)}")
        if self.guide_drag[0] < 0.0:
            raise IdentificationError(
                f"guide_drag must not be negative, got {self.guide_drag[0]} N"
            )
        if not self.young_factor > 1.0:
            raise IdentificationError(f"young_factor must exceed 1, got {self.young_factor}")
        if not 0.0 <= self.steady <= 1.0:
            raise IdentificationError(f"steady must lie in [0, 1], got {self.steady}")

    @property
    def young_deviation(self) -> float:
        """Standard deviation of ln E."""
        return math.log(self.young_factor)


# The tension at the cylinder is the stated one: a load cell in the span.
KNOWN_TENSION = RigPrior(
    load_share=(1.0, 1.0),
    guide_drag=(0.0, 0.0),
    steady=1.0,
    build_up_length=(0.2, 0.2),
    held=(1.0, 1.0),
)


@dataclass(frozen=True, kw_only=True)
class RigCoordinates:
    """From coordinates (n, 6), build-up lengths and whether the tension is steady to rigs.

    Markers determine the stretch at which the cable was laid, not what made it: E, load share and
    drag hide behind each other. So the first coordinate is that stretch, and E follows.
    """

    prior: RigPrior  # What was known
    young: float  # E as configured [Pa]
    free_length: float  # As configured [m]
    pull: float  # Mean stated tension while the markers were wound [N]
    area: float  # That carries it [m^2]
    wound: float  # Length of cable on the cylinder up to the last marker that was used [m]

    def rigs(self, q: FloatArray, build_up: FloatArray, steady: NDArray[np.bool_]) -> Rigs:
        """Return the rigs.

        Args:
            q: Shape (n, 6).
            build_up: L_c [m], shape (n,).
            steady: True where the tension does not build up, shape (n,).
        """
        from scipy.special import ndtr  # noqa: PLC0415 - live, beside the machine

        place = ndtr(np.clip(q[:, 1:], -_FARTHEST, _FARTHEST))
        prior = self.prior

        def within(limits: tuple[float, float], column: int) -> FloatArray:
            low, high = limits
            return np.asarray(low + (high - low) * place[:, column])

        share, drag = within(prior.load_share, 1), within(prior.guide_drag, 2)
        start = np.where(steady, 1.0, within(prior.start_share, 3))
        full = share * self.pull + drag
        return Rigs(
            young=full * self._mean_growth(start, build_up) / (self.area * np.exp(q[:, 0])),
            free_length=self.free_length * within(prior.free_length, 0),
            load_share=share,
            guide_drag=drag,
            start_share=start,
            build_up_length=build_up,
            held=within(prior.held, 4),
        )

    def surprise(self, q: FloatArray, rigs: Rigs) -> FloatArray:
        """Return the prior's residuals, standard normal each, shape (n, 6)."""
        deviate = np.log(rigs.young / self.young) / self.prior.young_deviation
        return np.column_stack([deviate, q[:, 1:]])

    def effective_young(self, rigs: Rigs) -> FloatArray:
        """Return E [Pa] of the cable that the stated tension alone would stretch as much, (n,)."""
        full = rigs.load_share * self.pull + rigs.guide_drag
        landed = full * self._mean_growth(rigs.start_share, rigs.build_up_length)
        return np.asarray(rigs.young * self.pull / landed)

    def _mean_growth(self, start: FloatArray, build_up: FloatArray) -> FloatArray:
        decay = -np.expm1(-self.wound / build_up) * build_up / self.wound
        return np.asarray(np.maximum(1.0 - (1.0 - start) * decay, 1.0e-3))

    def start(self, stress: float) -> FloatArray:
        """Return where a search begins, from the mean stress over E that markers show, (6,)."""
        return np.array([math.log(max(stress, 1.0e-4)), *np.zeros(COUNT - 1)])
