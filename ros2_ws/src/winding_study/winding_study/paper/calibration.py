"""Fit of the rig's span-tension law to the measured angles: five numbers for all twelve cases."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.cases import paper_case, published_markers
from winding_core.lay.quasi_static import QuasiStaticLay
from winding_core.machine.tension import START, RigTension, TensionFit, fit_rig_tension
from winding_core.units import json_values

Array = NDArray[np.float64]

LAW = "neo_hookean"


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """A fitted span-tension law and how well it explains the measured angles."""

    law: str  # Material law of the cable
    tension: RigTension  # The fitted law
    standard_errors: tuple[float, ...]  # Of its five numbers, in order, from the fit's curvature
    in_sample_rms_pct: float  # Relative root mean square of theta, all cells fitted
    leave_one_case_out_rms_pct: float  # The same, each case predicted from the other eleven
    # Predicted over measured theta, minus one, by (case, marker), in sample.
    residuals_pct: dict[tuple[int, int], float]

    def as_json(self) -> dict[str, Any]:
        """Return the calibration as JSON values."""
        return {
            "law": self.law,
            "tension": asdict(self.tension),
            "standard_errors": dict(zip(asdict(self.tension), self.standard_errors, strict=True)),
            **json_values(self, "in_sample_rms_pct", "leave_one_case_out_rms_pct"),
            "cells": [
                {"case": case, "marker": marker, "dtheta_pct": residual}
                for (case, marker), residual in self.residuals_pct.items()
            ],
        }


def calibrate(law: str = LAW, progress: Callable[[int], None] | None = None) -> Calibration:
    """Return the span-tension law that explains the measured angles best.

    The law's form was found on these very cells, so that even its left-out error flatters it.

    Args:
        law: Material law of the cable.
        progress: Called with each case after the fit that left it out.
    """
    rows = [row for row in published_markers() if row.experiment is not None]
    cases = sorted({row.case for row in rows})
    models = {case: QuasiStaticLay(paper_case(case), law) for case in cases}
    measured = {
        case: np.array([r.experiment.theta for r in rows if r.case == case and r.experiment])
        for case in cases
    }

    def residuals(tension: RigTension, asked: Sequence[int]) -> Array:
        parts = [
            models[case].theta(tension)[: len(measured[case])] / measured[case] - 1.0
            for case in asked
        ]
        return np.concatenate(parts)

    def fit(asked: Sequence[int], start: RigTension) -> TensionFit:
        return fit_rig_tension(lambda tension: residuals(tension, asked), start)

    whole = fit(cases, START)
    left_out = []
    for case in cases:
        without = fit([other for other in cases if other != case], whole.tension)
        left_out.append(residuals(without.tension, [case]))
        if progress is not None:
            progress(case)
    return Calibration(
        law=law,
        tension=whole.tension,
        standard_errors=whole.standard_errors,
        in_sample_rms_pct=_rms_pct(whole.residuals),
        leave_one_case_out_rms_pct=_rms_pct(np.concatenate(left_out)),
        residuals_pct={
            (row.case, row.marker): 100.0 * float(residual)
            for row, residual in zip(rows, whole.residuals, strict=True)
        },
    )


def _rms_pct(residuals: Array) -> float:
    return 100.0 * float(np.sqrt(np.mean(residuals**2)))
