"""The constants of a nonlinear law from runs of one cable under different tensions."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.identification.fit import Fit, fit
from cable_fem_node.identification.modulus import PLAUSIBLE_YOUNG
from cable_fem_node.identification.quasi_static import softest_young
from cable_fem_node.identification.search import FitConfig, Search
from cable_fem_node.identification.tracked_run import IdentificationError, TrackedRun
from winding_core.cable.material_law import MaterialLaw

# C01 may be this share of C10 + C01 at most; beyond 1 the law softens in compression.
_SHARES = (0.0, 0.95)
_START_SHARE = 0.2
# A share known less well than this is not identified: any allowed one could be true.
_SEPARABLE = 0.25


@dataclass(frozen=True, kw_only=True)
class ConstantsEstimate:
    """Identified constants of the Neo-Hookean or Mooney-Rivlin law."""

    law: str  # "neo_hookean" or "mooney_rivlin"
    c10: float  # [Pa]
    c01: float  # [Pa], zero for Neo-Hookean
    standard_errors: tuple[float, float]  # Of C10 and C01 [Pa]
    young: float  # 4 (1 + nu) (C10 + C01) [Pa]
    young_standard_error: float  # [Pa]
    share: float  # C01 / (C10 + C01)
    share_standard_error: float  # Of it
    fit: Fit  # The search behind it

    @property
    def separable(self) -> bool:
        """Whether the runs determine C10 and C01, and not only their sum."""
        return self.law != "mooney_rivlin" or self.share_standard_error <= _SEPARABLE

    def statement(self) -> str:
        """Return in one sentence what the constants are worth."""
        if self.law == "neo_hookean":
            return "Neo-Hookean has one constant, C10; C01 is zero"
        if self.separable:
            return (
                f"C10 and C01 are distinguished: C01 is {self.share:.0%} of their sum, "
                f"standard error {self.share_standard_error:.0%}"
            )
        return (
            "C10 and C01 are not separable: these tensions stretch the cable too alike, and only "
            f"their sum is known (share of C01: standard error {self.share_standard_error:.0%}, "
            f"limit {_SEPARABLE:.0%})"
        )


def identify_constants(
    runs: Sequence[TrackedRun],
    law: str = "mooney_rivlin",
    config: FitConfig | None = None,
    *,
    going: Callable[[], bool] = lambda: True,
) -> ConstantsEstimate:
    """Return C10 and C01 whose rod lays the markers of all runs where they were measured.

    Args:
        runs: Of one cable under at least two tensions.
        law: "neo_hookean" or "mooney_rivlin"; Poisson's ratio is the configuration's.
        config: Beliefs and limits.
        going: Called repeatedly; false when the result is no longer wanted.

    Raises:
        IdentificationError: Another law, fewer than two runs, or no fit.
        AbandonedError: `going` returned false.
    """
    if law not in ("neo_hookean", "mooney_rivlin"):
        raise IdentificationError(
            f"constants are those of neo_hookean or mooney_rivlin, got law {law!r}"
        )
    if len(runs) < 2:
        raise IdentificationError(
            f"the constants of a nonlinear law need runs under two tensions, got {len(runs)}"
        )
    two = law == "mooney_rivlin"
    poisson = runs[0].config.case.material.poisson

    def family(p: FloatArray) -> MaterialLaw:
        share = float(p[1]) if two else 0.0
        return MaterialLaw(
            law=law,
            young=4.0 * (1.0 + poisson) * math.exp(float(p[0])),
            poisson=poisson,
            mooney_ratio=share / (1.0 - share),
        )

    softest = max(softest_young(run, law) for run in runs)
    per_young = 0.25 / (1.0 + poisson)
    low = math.log(per_young * max(PLAUSIBLE_YOUNG[0], softest))
    high = math.log(per_young * PLAUSIBLE_YOUNG[1])
    if low >= high:
        raise IdentificationError(f"no {law} up to {PLAUSIBLE_YOUNG[1] / 1e6:g} MPa carries it")
    start = math.log(per_young * runs[0].config.case.material.young)
    bounds = (
        np.array([low, _SHARES[0]] if two else [low]),
        np.array([high, _SHARES[1]] if two else [high]),
    )
    search = Search(runs, family, bounds, config or FitConfig(), going)
    found = fit(search, np.array([start, _START_SHARE] if two else [start]))
    total = math.exp(float(found.parameters[0]))
    share = float(found.parameters[1]) if two else 0.0
    # Derivatives of (C10, C01) with respect to (ln total, share).
    slope = np.array([[total * (1.0 - share), -total], [total * share, total]])[:, : 1 + two]
    errors = np.sqrt(np.diag(slope @ found.covariance @ slope.T))
    return ConstantsEstimate(
        law=law,
        c10=total * (1.0 - share),
        c01=total * share,
        standard_errors=(float(errors[0]), float(errors[1])),
        young=total / per_young,
        young_standard_error=total / per_young * math.sqrt(float(found.covariance[0, 0])),
        share=share,
        share_standard_error=math.sqrt(float(found.covariance[1, 1])) if two else 0.0,
        fit=found,
    )
