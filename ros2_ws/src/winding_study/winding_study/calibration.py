"""Fit of the rig's span-tension law to the measured angles: five numbers for all twelve cases."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from cable_fem_node.winding import RigTension, UniaxialLaw, WindingConfig
from cable_winding.cases import Case, paper_case
from cable_winding.drive import DriveProfile
from cable_winding.fleet import PAPER_FREE_LENGTH, FleetAngleLaw
from cable_winding.published import published_markers

Array = NDArray[np.float64]

LAW = "neo_hookean"
# offset [N], weight_share, diameter_gain [N], start_share, build_up_length [m]: where the search
# begins, how far it steps, and how far it may go.
_START = (1.5, 0.4, 1.0, 0.4, 0.25)
_STEP = (1.0, 0.3, 1.0, 0.3, 0.2)
_LOW = (-5.0, 0.0, -5.0, 0.0, 0.01)
_HIGH = (10.0, 2.0, 10.0, 1.5, 5.0)
_ANGLE_STEP = 0.05
_STRETCHES = 4000
_STRETCH_RANGE = (0.7, 3.5)


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """A fitted span-tension law and how well it explains the measured angles.

    Attributes:
        law: Material law of the cable.
        tension: The fitted law.
        standard_errors: Of its five numbers, in order, from the fit's curvature.
        in_sample_rms_pct: Relative root mean square of theta, all cells fitted.
        leave_one_case_out_rms_pct: The same, each case predicted from the other eleven.
        residuals_pct: Predicted over measured theta, minus one, by (case, marker), in sample.
    """

    law: str
    tension: RigTension
    standard_errors: tuple[float, ...]
    in_sample_rms_pct: float
    leave_one_case_out_rms_pct: float
    residuals_pct: dict[tuple[int, int], float]

    def as_json(self) -> dict[str, Any]:
        """Return the calibration as JSON values."""
        return {
            "law": self.law,
            "tension": asdict(self.tension),
            "standard_errors": dict(zip(asdict(self.tension), self.standard_errors, strict=True)),
            "in_sample_rms_pct": self.in_sample_rms_pct,
            "leave_one_case_out_rms_pct": self.leave_one_case_out_rms_pct,
            "cells": [
                {"case": case, "marker": marker, "dtheta_pct": residual}
                for (case, marker), residual in self.residuals_pct.items()
            ],
        }


class LayOn:
    """Quasi-static angles of the markers of one case under any span tension.

    Cable lies down at rho dtheta with the stretch that the span's tension gives it, less
    EI l / (2 rho^2) for bending, along the path of the fleet-angle law, and sticks. This is what
    the rod does without inertia, in closed form up to one integral.
    """

    def __init__(self, case: Case, law: str) -> None:
        self.case = case
        self._config = WindingConfig(case=case)
        self._stretch, self._stress, self._lateral = _tabulated(
            UniaxialLaw(law=law, young=case.material.young, poisson=case.material.poisson)
        )
        if law == "linear":
            self._lateral = np.ones_like(self._lateral)
        # No measured cable is stretched to more than twice its length or lies closer.
        reach = 2.0 * case.original_length(case.marker_count) / case.centreline_radius
        self._theta = np.arange(0.0, reach, _ANGLE_STEP)
        self._slope = FleetAngleLaw(
            advance_per_radian=DriveProfile().advance_per_radian,
            free_length=PAPER_FREE_LENGTH,
            radius=case.centreline_radius,
        ).slope(self._theta)

    def theta(self, tension: RigTension) -> Array:
        """Return the wound angle of each marker [rad], shape (marker_count,)."""
        case = self.case
        span = np.array(
            [
                tension(case.weight, case.cylinder_diameter, case.centreline_radius * angle)
                for angle in self._theta
            ]
        )
        radius = self._radius(self._at(span))
        bent = 0.5 * self._config.bending_stiffness * self._at(span) / radius**2
        stretch = self._at(span - bent)
        reference_per_radian = np.hypot(self._radius(stretch), self._slope) / stretch
        between = 0.5 * (reference_per_radian[1:] + reference_per_radian[:-1]) * _ANGLE_STEP
        laid = np.concatenate([[0.0], np.cumsum(between)])
        markers = case.marker_spacing * np.arange(1, case.marker_count + 1)
        return np.asarray(np.interp(markers, laid, self._theta))

    def _at(self, force: Array) -> Array:
        return np.interp(force / self.case.section_area, self._stress, self._stretch)

    def _radius(self, stretch: Array) -> Array:
        lateral = np.interp(stretch, self._stretch, self._lateral)
        return np.asarray(self.case.cylinder_radius + self.case.cable_radius * lateral)


def calibrate(law: str = LAW, progress: Callable[[int], None] | None = None) -> Calibration:
    """Return the span-tension law that explains the measured angles best.

    The law's form was found on these very cells, so that even its left-out error flatters it.

    Args:
        law: Material law of the cable.
        progress: Called with each case after the fit that left it out.
    """
    rows = [row for row in published_markers() if row.experiment is not None]
    cases = sorted({row.case for row in rows})
    models = {case: LayOn(paper_case(case), law) for case in cases}
    measured = {
        case: np.array([r.experiment.theta for r in rows if r.case == case and r.experiment])
        for case in cases
    }

    def residuals(numbers: Array, asked: Sequence[int]) -> Array:
        tension = _law_of(numbers)
        parts = [
            models[case].theta(tension)[: len(measured[case])] / measured[case] - 1.0
            for case in asked
        ]
        return np.concatenate(parts)

    def fit(asked: Sequence[int], start: Sequence[float]) -> Any:
        return least_squares(
            residuals, start, x_scale=_STEP, bounds=(_LOW, _HIGH), args=(asked,), method="trf"
        )

    whole = fit(cases, _START)
    left_out = []
    for case in cases:
        without = fit([other for other in cases if other != case], whole.x)
        left_out.append(residuals(without.x, [case]))
        if progress is not None:
            progress(case)
    variance = np.sum(whole.fun**2) / (len(whole.fun) - len(whole.x))
    errors = np.sqrt(np.diag(np.linalg.inv(whole.jac.T @ whole.jac)) * variance)
    return Calibration(
        law=law,
        tension=_law_of(whole.x),
        standard_errors=tuple(errors.tolist()),
        in_sample_rms_pct=_rms_pct(whole.fun),
        leave_one_case_out_rms_pct=_rms_pct(np.concatenate(left_out)),
        residuals_pct={
            (row.case, row.marker): 100.0 * float(residual)
            for row, residual in zip(rows, whole.fun, strict=True)
        },
    )


def _law_of(numbers: Array) -> RigTension:
    offset, share, gain, start, length = (float(number) for number in numbers)
    return RigTension(
        offset=offset,
        weight_share=share,
        diameter_gain=gain,
        start_share=start,
        build_up_length=length,
    )


def _tabulated(law: UniaxialLaw) -> tuple[Array, Array, Array]:
    low, high = _STRETCH_RANGE
    _, limit = law.limit()
    stretch = np.linspace(low, min(high, limit), _STRETCHES)
    return stretch, law.nominal_stress(stretch), law.lateral_stretch(stretch)


def _rms_pct(residuals: Array) -> float:
    return 100.0 * float(np.sqrt(np.mean(residuals**2)))
