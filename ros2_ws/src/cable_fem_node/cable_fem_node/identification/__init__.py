"""From where markers lie back to the material of the cable and the rig that wound it."""

from cable_fem_node.identification.fit import Fit, MarkerResidual
from cable_fem_node.identification.modulus import ModulusEstimate, identify_modulus, with_young
from cable_fem_node.identification.rig_posterior import RigPosterior, identify_rig
from cable_fem_node.identification.search import FitConfig
from cable_fem_node.identification.tracked_run import (
    DEFAULT_SIGMA_THETA,
    DEFAULT_SIGMA_Z,
    IdentificationError,
    Readings,
    TrackedRun,
)
from cable_fem_node.winding.rig_prior import KNOWN_TENSION, RigPrior

__all__ = [
    "DEFAULT_SIGMA_THETA",
    "DEFAULT_SIGMA_Z",
    "KNOWN_TENSION",
    "Fit",
    "FitConfig",
    "IdentificationError",
    "MarkerResidual",
    "ModulusEstimate",
    "Readings",
    "RigPosterior",
    "RigPrior",
    "TrackedRun",
    "identify_modulus",
    "identify_rig",
    "with_young",
]
