"""How far markers may lie from where the closed form of the right rig lays them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cable_fem_node.dynamics.points import FloatArray
from cable_fem_node.identification.rig import RigPrior
from cable_fem_node.identification.tracked_run import TrackedRun

# Measured on 91 rods with elements of 2.5 mm, whose rigs were drawn from the default prior:
# part of every angle, common to a run, without bending; the same as a share of what bending does
# to the stretch; an offset of all angles [rad]; the parts of z.
_ANGLE_SHARE = 0.4e-4
_BENDING_SHARE = 0.17
_OFFSET = 0.7e-3
_Z_SHARE = 0.6e-3
_Z_OFFSET = 0.018e-3


@dataclass(frozen=True, kw_only=True)
class RigDeviations:
    """Covariances of all markers of a run, P1 first; the tracker's share is not in them.

    Attributes:
        theta: [rad^2], shape (m, m).
        z: [m^2], shape (m, m).
    """

    theta: FloatArray
    z: FloatArray


def deviations_of(
    run: TrackedRun, prior: RigPrior, theta: FloatArray, z: FloatArray
) -> RigDeviations:
    """Return the deviations of model and machine.

    Args:
        run: What is wound.
        prior: Says how well markers were fixed and painted.
        theta: About where the markers lie [rad], shape (m,).
        z: [m], shape (m,).
    """
    case = run.config.case
    radius = case.centreline_radius
    # The stretch that bending takes: EI / (2 EA rho^2), whatever E is.
    bent = 0.5 * case.bending_stiffness / (case.material.young * case.axial_area) / radius**2
    share = np.hypot(_ANGLE_SHARE, _BENDING_SHARE * bent)
    one = np.ones(theta.size)
    own = prior.scatter**2 * np.eye(theta.size)
    common = prior.fixing**2 * np.outer(one, one)
    return RigDeviations(
        theta=share**2 * np.outer(theta, theta)
        + _OFFSET**2 * np.outer(one, one)
        + (own + common) / radius**2,
        z=_Z_SHARE**2 * np.outer(z, z)
        + _Z_OFFSET**2 * (np.outer(one, one) + np.eye(theta.size))
        + own
        + common,
    )
