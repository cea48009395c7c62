"""Laws fitted to a tensile test: nominal stress over nominal strain."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.identification.tracked_run import IdentificationError
from winding_core.cable.material_law import LAWS, MaterialLaw

LEAST_POINTS = 3
# C01 over C10 + C01.
_SHARES = (-0.5, 0.95)
_START_SHARE = 0.2
# Burnham and Anderson, Model Selection (2002), section 2.6: below 2 the rival is as well supported.
_TIE = 2.0


@dataclass(frozen=True, kw_only=True)
class TensileTest:
    """A measured stress-strain curve, in any order."""

    strain: FloatArray  # Nominal strain, elongation over reference length, shape (n,), n >= 3
    stress: FloatArray  # Nominal stress, force over reference section [Pa], shape (n,)

    def __post_init__(self) -> None:
        if self.strain.shape != self.stress.shape or self.strain.ndim != 1:
            raise IdentificationError("a tensile test needs one stress per strain")
        if self.strain.size < LEAST_POINTS:
            raise IdentificationError(
                f"a tensile test needs at least {LEAST_POINTS} points, got {self.strain.size}"
            )
        for i, (strain, stress) in enumerate(zip(self.strain, self.stress, strict=True), start=1):
            for name, value in (("strain", strain), ("stress", stress)):
                if not math.isfinite(value):
                    raise IdentificationError(f"{name} of point {i} must be finite, got {value}")
                if value < 0.0:
                    raise IdentificationError(
                        f"{name} of point {i} must not be negative, got {value:g}"
                    )
        if np.unique(self.strain[self.strain > 0.0]).size < LEAST_POINTS - 1:
            raise IdentificationError("a tensile test needs at least 2 different positive strains")
        if not self.stress.max() > 0.0:
            raise IdentificationError("a tensile test needs a positive stress, all are zero")


@dataclass(frozen=True, kw_only=True)
class LawFit:
    """One law fitted to a tensile test."""

    law: str  # One of uniaxial.LAWS
    young: float  # E [Pa]
    young_standard_error: float  # [Pa], from the scatter of the residuals
    share: float  # C01 / (C10 + C01); zero for every law but Mooney-Rivlin
    share_standard_error: float  # Of it
    rms: float  # Root mean square of the residuals [Pa]
    # Akaike's criterion for Gaussian residuals, corrected for few points; infinite where there are
    # too few.
    aicc: float

    def material(self, poisson: float) -> MaterialLaw:
        """Return the fitted law."""
        return MaterialLaw(
            law=self.law,
            young=self.young,
            poisson=poisson,
            mooney_ratio=self.share / (1.0 - self.share),
        )


def fit_laws(test: TensileTest, poisson: float, laws: Sequence[str] = LAWS) -> tuple[LawFit, ...]:
    """Return every law's fit by least squares of the stress, best first by AICc.

    Args:
        test: Points.
        poisson: nu, dimensionless; a test without lateral strain does not give it.
        laws: Which.
    """
    fits = [_fitted(test, law, poisson) for law in laws]
    return tuple(sorted(fits, key=lambda item: (item.aicc, item.rms)))


def judgement(fits: Sequence[LawFit]) -> str:
    """Return in one sentence which law fits best, and whether another is as good."""
    best, *others = fits
    if not math.isfinite(best.aicc):
        return "there are too few points to tell the laws apart"
    ties = [item.law for item in others if item.aicc - best.aicc < _TIE]
    if ties:
        return (
            f"{best.law} fits best, but {', '.join(ties)} cannot be distinguished from it: "
            f"AICc differs by less than {_TIE:g}"
        )
    gap = min((item.aicc - best.aicc for item in others), default=math.inf)
    return f"{best.law} fits best: its AICc is {gap:.1f} below the next law's"


def _fitted(test: TensileTest, law: str, poisson: float) -> LawFit:
    stretch = 1.0 + test.strain
    two = law == "mooney_rivlin"

    def unit(share: float) -> FloatArray:
        bar = MaterialLaw(law=law, young=1.0, poisson=poisson, mooney_ratio=share / (1.0 - share))
        return bar.nominal_stress(stretch)

    # In units of the greatest stress, E follows linearly from any share.
    top = float(test.stress.max())
    stress = test.stress / top

    def misses(p: FloatArray) -> FloatArray:
        return np.asarray(p[0] * unit(float(p[1]) if two else 0.0) - stress)

    shape = unit(_START_SHARE if two else 0.0)
    start = float(shape @ stress / (shape @ shape))
    if two:
        low, high = _SHARES
        found = least_squares(misses, [start, _START_SHARE], bounds=([1e-12, low], [np.inf, high]))
    else:
        found = least_squares(misses, [start], bounds=([1e-12], [np.inf]))
    count, free = stress.size, found.x.size
    squares = float(found.fun @ found.fun)
    variance = squares / (count - free) if count > free else math.inf
    errors = np.sqrt(np.diag(np.linalg.pinv(found.jac.T @ found.jac)) * variance)
    return LawFit(
        law=law,
        young=float(found.x[0]) * top,
        young_standard_error=float(errors[0]) * top,
        share=float(found.x[1]) if two else 0.0,
        share_standard_error=float(errors[1]) if two else 0.0,
        rms=top * math.sqrt(squares / count),
        aicc=_aicc(squares, count, free + 1),
    )


def _aicc(squares: float, count: int, free: int) -> float:
    """Return Akaike's corrected criterion; the variance of the residuals is a parameter too."""
    if count - free - 1 <= 0:
        return math.inf
    # An exact curve would give minus infinity; 1e-12 is rounding in units of the top stress.
    spread = math.log(max(squares / count, 1.0e-24))
    return count * spread + 2.0 * free + 2.0 * free * (free + 1) / (count - free - 1)
