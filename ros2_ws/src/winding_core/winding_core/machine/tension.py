"""Tension of the span: laws of the load on the cable, and their least-squares fit."""

import math
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, fields
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from winding_core.helix import FloatOrArray

REFERENCE_DIAMETER = 45.0e-3  # The drum diameter in the middle of the two that were measured


class TensionLaw(Protocol):
    """Span tension [N] from weight [N], cylinder diameter [m] and wound length [m]."""

    def __call__(self, weight: float, cylinder_diameter: float, wound_length: float) -> float:
        """Return the tension [N]."""
        ...


@dataclass(frozen=True, kw_only=True)
class DeadWeight:
    """The span carries the weight, from the first turn to the last."""

    def __call__(self, weight: float, cylinder_diameter: float, wound_length: float) -> float:
        """Return the weight [N]."""
        return weight

    def along(
        self, weight: FloatOrArray, cylinder_diameter: float, wound_lengths: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the tension [N] at every wound length [m], same shape; a weight [N] for each."""
        return np.full(wound_lengths.shape, weight)


@dataclass(frozen=True, kw_only=True)
class RigTension:
    """Calibratable rig: (F0 + a T_w + b (D / 45 mm - 1)) [f0 + (1 - f0)(1 - exp(-s / L_c))]."""

    offset: float = 0.0  # F0 [N].
    weight_share: float = 1.0  # a.
    diameter_gain: float = 0.0  # b [N].
    start_share: float = 1.0  # f0, share of the final tension at the start.
    build_up_length: float = 0.255  # L_c [m] of wound cable.

    def __post_init__(self) -> None:
        for name in ("offset", "weight_share", "diameter_gain", "start_share"):
            if not math.isfinite(getattr(self, name)):
                raise ValueError(f"{name} must be finite, got {getattr(self, name)}")
        if not self.build_up_length > 0.0:
            raise ValueError(f"build_up_length must be positive, got {self.build_up_length} m")

    def __call__(self, weight: float, cylinder_diameter: float, wound_length: float) -> float:
        """Return the tension [N]; never below zero."""
        built = -math.expm1(-max(wound_length, 0.0) / self.build_up_length)
        final = self.final(weight, cylinder_diameter)
        return max(0.0, final * (self.start_share + (1.0 - self.start_share) * built))

    def along(
        self, weight: FloatOrArray, cylinder_diameter: float, wound_lengths: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the tension [N] at every wound length [m], same shape; a weight [N] for each."""
        built = -np.expm1(-np.maximum(wound_lengths, 0.0) / self.build_up_length)
        final = self.final(weight, cylinder_diameter)
        return np.asarray(
            np.maximum(0.0, final * (self.start_share + (1.0 - self.start_share) * built))
        )

    @property
    def is_dead_weight(self) -> bool:
        """Whether the tension is the weight from the first turn to the last."""
        return (self.offset, self.weight_share, self.diameter_gain) == (0.0, 1.0, 0.0) and (
            self.start_share == 1.0
        )

    def final(self, weight: FloatOrArray, cylinder_diameter: float) -> FloatOrArray:
        """Return F0 + a T_w + b (D / 45 mm - 1) [N], where the build-up ends."""
        return (
            self.offset
            + self.weight_share * weight
            + self.diameter_gain * (cylinder_diameter / REFERENCE_DIAMETER - 1.0)
        )


Array = NDArray[np.float64]

# Where the search begins, how far it steps, and how far it may go.
START = RigTension(
    offset=1.5, weight_share=0.4, diameter_gain=1.0, start_share=0.4, build_up_length=0.25
)
_STEP = (1.0, 0.3, 1.0, 0.3, 0.2)
_LOW = (-5.0, 0.0, -5.0, 0.0, 0.01)
_HIGH = (10.0, 2.0, 10.0, 1.5, 5.0)


@dataclass(frozen=True, kw_only=True)
class TensionFit:
    """A fitted span-tension law."""

    tension: RigTension  # The law.
    residuals: Array  # At the fit, shape (n,).
    # Of the law's five numbers, in order, from the fit's curvature.
    standard_errors: tuple[float, ...]


def fit_rig_tension(
    residuals: Callable[[RigTension], Array], start: RigTension = START
) -> TensionFit:
    """Return the law whose residuals have the smallest sum of squares.

    Args:
        residuals: Residuals of a law, shape (n,), n > 5.
        start: Where the search begins.
    """
    from scipy.optimize import least_squares  # noqa: PLC0415

    found = least_squares(
        lambda numbers: residuals(_law_of(numbers)),
        astuple(start),
        x_scale=_STEP,
        bounds=(_LOW, _HIGH),
        method="trf",
    )
    variance = np.sum(found.fun**2) / (len(found.fun) - len(found.x))
    errors = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)) * variance)
    return TensionFit(
        tension=_law_of(found.x),
        residuals=np.asarray(found.fun),
        standard_errors=tuple(errors.tolist()),
    )


def _law_of(numbers: Sequence[float] | Array) -> RigTension:
    names = (item.name for item in fields(RigTension))
    return RigTension(**dict(zip(names, map(float, numbers), strict=True)))
