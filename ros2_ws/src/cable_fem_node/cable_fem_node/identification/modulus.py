"""The effective Young's modulus of a cable from where its markers lie."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.identification.fit import Fit, fit, half_width
from cable_fem_node.identification.quasi_static import softest_young
from cable_fem_node.identification.search import FitConfig, RodExcess, Search
from cable_fem_node.identification.tracked_run import IdentificationError, TrackedRun
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.material_law import MaterialLaw

# From softer than any gel to the stiffest modulus that a condition takes [Pa].
PLAUSIBLE_YOUNG = (0.05e6, 1.0e12)
# A fit that misses a marker by more than this share of its angle is not of this cable.
WORST_SHARE = 0.05
WORST_ERROR = 0.5  # What is known no better than this, nine times in ten, is not worth taking up


@dataclass(frozen=True, kw_only=True)
class ModulusEstimate:
    """An identified Young's modulus."""

    law: str  # Material law that was fitted
    young: float  # E [Pa]
    standard_error: float  # Of E [Pa]
    half_width_90: float  # E lies within this of `young` nine times in ten [Pa]
    fit: Fit  # The search behind it

    @property
    def markers(self) -> tuple[int, ...]:
        """Numbers of the markers used."""
        return tuple(row.id for row in self.fit.residuals)

    def refusal(self) -> str:
        """Return why the estimate must not be used; empty where nothing speaks against it."""
        low, high = PLAUSIBLE_YOUNG
        if not low * 1.01 < self.young < high / 1.01:
            return (
                f"an effective modulus of {self.young / 1e6:.4g} MPa is not between "
                f"{low / 1e6:g} and {high / 1e6:g} MPa"
            )
        if self.fit.worst_share > WORST_SHARE:
            return (
                f"the best modulus misses a marker by {self.fit.worst_share:.1%} of its angle "
                f"(limit {WORST_SHARE:.0%})"
            )
        if self.half_width_90 > WORST_ERROR * self.young:
            cause = (
                "one modulus does not explain the markers"
                if self.fit.misfit
                else ("the cable is stretched too little")
            )
            return (
                f"the modulus is known to {self.half_width_90 / self.young:.0%} only "
                f"(limit {WORST_ERROR:.0%}): {cause}"
            )
        return ""


def with_young(config: WindingConfig, young: float) -> WindingConfig:
    """Return a configuration with another Young's modulus [Pa]."""
    return config.with_law(dataclasses.replace(config.resolved.law, young=young))


def identify_modulus(
    runs: Sequence[TrackedRun],
    config: FitConfig | None = None,
    *,
    going: Callable[[], bool] = lambda: True,
    before: RodExcess | None = None,
) -> ModulusEstimate:
    """Return the Young's modulus whose rod lays the markers where they were measured.

    Args:
        runs: Of one cable, at least one; law and start are those of the configurations.
        config: Assumed deviations and limits.
        going: Returns whether the result is still wanted; called repeatedly.
        before: The rod's answers to an earlier search of the same run, see `Search`.

    Raises:
        IdentificationError: There is no modulus, or the runs contradict each other.
        AbandonedError: `going` returned False.
    """
    if not runs:
        raise IdentificationError("identification needs at least one run, got none")
    first = runs[0].config
    if any(run.config.law != first.law for run in runs):
        raise IdentificationError("all runs of one cable must be fitted with one law")

    def family(p: FloatArray) -> MaterialLaw:
        return dataclasses.replace(first.resolved.law, young=math.exp(float(p[0])))

    softest = max(softest_young(run, run.config.law) for run in runs)
    low = math.log(max(PLAUSIBLE_YOUNG[0], softest))
    high = math.log(PLAUSIBLE_YOUNG[1])
    if low >= high:
        raise IdentificationError(
            f"no modulus up to {PLAUSIBLE_YOUNG[1] / 1e6:g} MPa carries the tension of "
            f"{max(run.highest_tension for run in runs):.4g} N"
        )
    start = np.array([math.log(first.case.material.young)])
    bounds = np.array([low]), np.array([high])
    found = fit(Search(runs, family, bounds, config or FitConfig(), going, before), start)
    young = math.exp(float(found.parameters[0]))
    error = math.sqrt(float(found.covariance[0, 0]))
    return ModulusEstimate(
        law=first.law,
        young=young,
        standard_error=young * error,
        half_width_90=young * half_width(error, found.quantile),
        fit=found,
    )
