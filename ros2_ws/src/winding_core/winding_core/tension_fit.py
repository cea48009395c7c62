"""Least-squares fit of the rig's span-tension law to what is known of a cable's lay."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from winding_core.tension import RigTension

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
    """A fitted span-tension law.

    Attributes:
        tension: The law.
        residuals: At the fit, shape (n,).
        standard_errors: Of the law's five numbers, in order, from the fit's curvature.
    """

    tension: RigTension
    residuals: Array
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
    offset, share, gain, start, length = (float(number) for number in numbers)
    return RigTension(
        offset=offset,
        weight_share=share,
        diameter_gain=gain,
        start_share=start,
        build_up_length=length,
    )
