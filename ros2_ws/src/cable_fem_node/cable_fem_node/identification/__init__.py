"""From where markers lie, or from a tensile test, back to the material of the cable."""

from cable_fem_node.identification.constants import ConstantsEstimate, identify_constants
from cable_fem_node.identification.failure import IdentificationError
from cable_fem_node.identification.fit import Fit, MarkerResidual
from cable_fem_node.identification.modulus import (
    ModulusEstimate,
    identify_modulus,
    with_young,
)
from cable_fem_node.identification.search import FitConfig
from cable_fem_node.identification.tensile import (
    LawFit,
    TensileTest,
    fit_laws,
    judgement,
)
from cable_fem_node.identification.tracked_run import (
    DEFAULT_SIGMA_THETA,
    DEFAULT_SIGMA_Z,
    Readings,
    TrackedRun,
)

__all__ = [
    "DEFAULT_SIGMA_THETA",
    "DEFAULT_SIGMA_Z",
    "ConstantsEstimate",
    "Fit",
    "FitConfig",
    "IdentificationError",
    "LawFit",
    "MarkerResidual",
    "ModulusEstimate",
    "Readings",
    "TensileTest",
    "TrackedRun",
    "fit_laws",
    "identify_constants",
    "identify_modulus",
    "judgement",
    "with_young",
]
