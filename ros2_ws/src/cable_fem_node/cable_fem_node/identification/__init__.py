"""From where markers lie back to the material of the cable."""

from cable_fem_node.identification.failure import IdentificationError
from cable_fem_node.identification.fit import Fit, MarkerResidual
from cable_fem_node.identification.modulus import (
    ModulusEstimate,
    identify_modulus,
    with_young,
)
from cable_fem_node.identification.search import FitConfig
from cable_fem_node.identification.tracked_run import (
    DEFAULT_SIGMA_THETA,
    DEFAULT_SIGMA_Z,
    Readings,
    TrackedRun,
)

__all__ = [
    "DEFAULT_SIGMA_THETA",
    "DEFAULT_SIGMA_Z",
    "Fit",
    "FitConfig",
    "IdentificationError",
    "MarkerResidual",
    "ModulusEstimate",
    "Readings",
    "TrackedRun",
    "identify_modulus",
    "with_young",
]
