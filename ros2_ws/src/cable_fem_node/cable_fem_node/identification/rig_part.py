"""One run of a rig that is sought: deviations and residuals of its markers for any rig."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.identification.rig import Numbers
from cable_fem_node.identification.rig_lay import RigLay
from cable_fem_node.identification.rig_rod import RodExcess
from cable_fem_node.identification.tracked_run import TrackedRun
from cable_fem_node.winding.rig_prior import RigPrior

# How far the closed form lies from rods of the default elements, rigs drawn from the default prior
# (seeds 0 to 29): a part of every angle, common to a run; an offset of all angles [rad]; the parts
# of z.
_ANGLE_SHARE = 0.2e-4
_OFFSET = 0.4e-3
_Z_SHARE = 0.4e-3
_Z_OFFSET = 0.015e-3
# Standard deviation of what elements and contact do to the wound stretch, over what the rod shows.
_UNSURE = 0.5
# Of an element's angle times the change of the stretch where cable slips: an element has a length,
# a cable has none. Rods of 0.8 times the element.
_SLIP_SHARE = 0.5
# What the closed form, corrected by the rod, misses beyond where pulls are commanded: the numbers
# are others than the rod's. Of angles relative to themselves and as an offset [rad], of z [m].
_CELL_SHARE, _CELL_OFFSET, _CELL_Z_OFFSET = 1.0e-4, 0.5e-3, 0.05e-3


@dataclass(frozen=True, kw_only=True)
class RigDeviations:
    """Covariances of all markers of a run, P1 first; the tracker's share is not in them."""

    theta: FloatArray  # [rad^2], shape (m, m)
    z: FloatArray  # [m^2], shape (m, m)


def deviations_of(
    lay: RigLay, prior: RigPrior, theta: FloatArray, z: FloatArray, about: Numbers | None = None
) -> RigDeviations:
    """Return the deviations of model and machine.

    Args:
        lay: Closed form of the run.
        prior: Contains how well markers were fixed and painted.
        theta: About where the markers lie [rad], shape (m,).
        z: [m], shape (m,).
        about: The rig, as far as it is known, shape (1,) each; None: nothing slips.
    """
    radius = lay.config.case.centreline_radius
    share = np.hypot(_ANGLE_SHARE, _UNSURE * lay.added_stretch())
    one = np.ones(theta.size)
    own = prior.scatter**2 * np.eye(theta.size)
    common = prior.fixing**2 * np.outer(one, one)
    slipped = np.zeros((theta.size, theta.size))
    slipped_z = np.zeros_like(slipped)
    if about is not None:
        both = np.outer(one, one) + np.eye(theta.size)
        slipped += _CELL_SHARE**2 * np.outer(theta, theta) + _CELL_OFFSET**2 * both
        slipped_z += _CELL_Z_OFFSET**2 * both
    for angle, change in [] if about is None else lay.slips(about):
        behind = (theta > angle) * (_SLIP_SHARE * lay.element * change)
        slipped += np.outer(behind, behind)
    return RigDeviations(
        theta=share**2 * np.outer(theta, theta)
        + slipped
        + _OFFSET**2 * np.outer(one, one)
        + (own + common) / radius**2,
        z=_Z_SHARE**2 * np.outer(z, z)
        + slipped_z
        + _Z_OFFSET**2 * (np.outer(one, one) + np.eye(theta.size))
        + own
        + common,
    )


@dataclass(frozen=True, kw_only=True)
class RigPart:
    """One run: its closed form, its used markers, and the whitening of their residuals."""

    run: TrackedRun  # Inputs and readings
    lay: RigLay  # Its closed form
    used: NDArray[np.intp]  # Index of each used marker among P1, P2, ..., shape (m,)
    excess: RodExcess | None  # What the rod adds to the used markers; None: nothing
    deviations: RigDeviations  # Of model and machine
    white_theta: FloatArray  # Makes residuals of angles standard normal, shape (m, m)
    white_z: FloatArray  # The same of z, shape (m, m)

    @classmethod
    def of(
        cls,
        run: TrackedRun,
        lay: RigLay,
        prior: RigPrior,
        about: Numbers | None = None,
        excess: RodExcess | None = None,
    ) -> RigPart:
        """Return the part of a run, see `deviations_of`, with what the rod adds to its markers."""
        readings = run.readings
        used = readings.ids - 1
        every = np.arange(1, lay.arc.size + 1)
        known = np.concatenate([[0], readings.ids])
        # About where all markers lie, those to come at the slope of the last ones.
        theta, z = (
            np.interp(every, known, np.concatenate([[0.0], values]))
            * np.maximum(1.0, every / readings.ids[-1])
            for values in (readings.theta, readings.z)
        )
        deviations = deviations_of(lay, prior, theta, z, about)
        pick = np.ix_(used, used)
        seen_theta, seen_z = np.diag(readings.sigma_theta**2), np.diag(readings.sigma_z**2)
        if excess is not None:
            more_theta, more_z = excess.covariances()
            seen_theta, seen_z = seen_theta + more_theta, seen_z + more_z
        return cls(
            run=run,
            lay=lay,
            used=used,
            excess=excess,
            deviations=deviations,
            white_theta=whitening(deviations.theta[pick] + seen_theta),
            white_z=whitening(deviations.z[pick] + seen_z),
        )

    def residuals(self, rigs: Numbers) -> FloatArray:
        """Return standard normal residuals of angles and then of z, shape (n, 2 m).

        Args:
            rigs: Shape (n,) each.
        """
        own = rigs if self.excess is None else rigs | {"held": np.ones(1)}
        theta, z = self.lay(own, int(self.used[-1]) + 1)
        readings = self.run.readings
        laid = np.hstack([theta[:, self.used], z[:, self.used]])
        if self.excess is not None:
            laid = laid + self.excess(rigs["held"])
        off_theta, off_z = np.hsplit(laid - np.concatenate([readings.theta, readings.z]), 2)
        return np.hstack([off_theta @ self.white_theta.T, off_z @ self.white_z.T])

    def worst_share(self, theta: FloatArray, weights: FloatArray) -> float:
        """Return the greatest residual of a used marker's mean angle relative to the angle.

        Args:
            theta: Of all markers on each rig [rad], shape (n, m).
            weights: Of the rigs, sum one, shape (n,).
        """
        return float(np.abs(weights @ theta[:, self.used] / self.run.readings.theta - 1.0).max())


def whitening(covariance: FloatArray) -> FloatArray:
    """Return what makes residuals of a covariance standard normal, shape (m, m)."""
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)))
