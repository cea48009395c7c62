"""Lays that are known ahead of the run: the paper's measurement, and a simulated cable's."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.cases import Case, published_markers
from winding_core.helix import FleetAngleLaw
from winding_core.machine.drive import DriveProfile
from winding_core.units import MILLIMETRE
from winding_rig_node.lay.lay_law import LayTruth

FloatArray = NDArray[np.float64]
# Names of the two lays, as a user chooses them.
PAPER, FEM = "paper", "fem"
_GRID_STEP = 0.02


def neo_hookean_stretch(load: float, guess: float = 1.0) -> float:
    """Return the stretch of an incompressible neo-Hookean bar under a nominal stress over E.

    sigma / E = (lambda - lambda^-2) / 3.

    Args:
        load: sigma / E, above -0.2, dimensionless.
        guess: Stretch where the search begins, dimensionless.
    """
    stretch, step = guess, math.inf
    # Newton's method squares its error: after a step of this size there is none left.
    while abs(step) > 1.0e-9:
        step = (3.0 * load - stretch + stretch**-2) / (1.0 + 2.0 * stretch**-3)
        stretch += step
    return stretch


@dataclass(frozen=True, kw_only=True)
class CableLay:
    """A laid cable in the cylinder's own frame."""

    path_theta: FloatArray  # Ascending wound angles behind P0 [rad], shape (n,)
    path_z: FloatArray  # Axial position there [m], shape (n,)
    # Wound angle of P0..Pm [rad], shape (m + 1,); nan for one that never lands.
    marker_theta: FloatArray

    def truth(self, turned: float) -> LayTruth:
        """Return the part that is wound with the cylinder at an angle [rad]."""
        theta = self.path_theta[self.path_theta <= turned]
        landed = np.where(self.marker_theta <= turned, self.marker_theta, np.nan)
        return LayTruth(
            hidden={},
            wound_angle=turned,
            theta=theta,
            z=self.path_z[: theta.size],
            length=np.empty(0),
            marker_theta=landed,
            marker_z=np.interp(landed, self.path_theta, self.path_z),
        )


@dataclass(frozen=True, kw_only=True)
class HiddenCable:
    """Properties of the simulated cable that no other node is given."""

    free_length: float  # True tangent span [m]
    load_factor: float  # Share of the weight that reaches the cylinder
    drag: float  # Constant guide friction [N]

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> HiddenCable:
        """Draw a plausible rig: the spread of what twelve published cases need."""
        return cls(
            free_length=rng.uniform(0.185, 0.21),
            load_factor=rng.uniform(0.5, 0.9),
            drag=rng.uniform(0.0, 0.3),
        )


def published_lay(case: Case, drive: DriveProfile, free_length: float, end: float) -> CableLay:
    """Return the paper's measured lay of a case (experiment columns of Tables 2-4).

    Between the measured markers the cable follows the fleet-angle law; what the measurement
    differs from the law is spread linearly from marker to marker.

    Args:
        case: One of the twelve published cases.
        drive: Speeds of the run.
        free_length: Tangent span of the fleet-angle law [m].
        end: Wound angle up to which the path is needed [rad].

    Raises:
        ValueError: The case is not a published one, or the feed does not lead to +z.
    """
    if not drive.feed_speed > 0.0:
        raise ValueError(
            f"lay {PAPER!r} was measured with a feed to +z, got "
            f"{drive.feed_speed / MILLIMETRE:g} mm/s; use lay {FEM!r}"
        )
    if not case.is_published:
        raise ValueError(
            f"lay {PAPER!r} needs a case of 1 to 12 with its own cable and markers, "
            f"as the paper measured it; use lay {FEM!r}"
        )
    markers = published_markers(case.number)
    measured = [marker.experiment for marker in markers]
    theta = np.array([0.0, *(lay.theta if lay else np.nan for lay in measured)])
    z = np.array([0.0, *(lay.z if lay else np.nan for lay in measured)])
    law = _law(case, drive, free_length)
    known = ~np.isnan(theta)
    grid = _grid(end, theta[known])
    residual = np.interp(grid, theta[known], z[known] - law.z(theta[known]))
    return CableLay(path_theta=grid, path_z=law.z(grid) + residual, marker_theta=theta)


def simulated_lay(case: Case, drive: DriveProfile, hidden: HiddenCable, end: float) -> CableLay:
    """Return the lay of a sticking neo-Hookean cable with hidden properties.

    The span tension and with it the stretch lambda are frozen in at lay-on, so the undeformed
    length laid per angle is hypot(R + r, dz/dtheta) / lambda. A cable with a Prony series creeps
    under its weight until it lands.

    Args:
        case: What is wound.
        drive: Speeds of the run.
        hidden: The rig's true cable.
        end: Wound angle up to which the path is needed [rad].
    """
    law = _law(case, drive, hidden.free_length)
    tension = hidden.drag + hidden.load_factor * case.weight
    young = case.material.young * case.material.axial_factor
    theta = _grid(end, np.empty(0))
    stretch = _stretches(case, drive, tension / (case.section_area * young), theta)
    way = np.hypot(case.centreline_radius, law.slope(theta)) / stretch
    pieces = 0.5 * (way[1:] + way[:-1]) * np.diff(theta)
    laid = np.concatenate([[0.0], np.cumsum(pieces)])
    marked = case.marker_spacing * np.arange(case.marker_count + 1)
    marker_theta = np.interp(marked, laid, theta, right=np.nan)
    return CableLay(path_theta=theta, path_z=law.z(theta), marker_theta=marker_theta)


def _stretches(
    case: Case, drive: DriveProfile, load: float, theta: FloatArray
) -> float | FloatArray:
    series = case.material.prony
    if not series.shares:
        return neo_hookean_stretch(load)
    loads = load * series.creep([drive.time_at_angle(angle) for angle in theta.tolist()])
    return np.array([neo_hookean_stretch(crept) for crept in loads.tolist()])


def _law(case: Case, drive: DriveProfile, free_length: float) -> FleetAngleLaw:
    return FleetAngleLaw(
        advance_per_radian=drive.advance_per_radian,
        free_length=free_length,
        radius=case.centreline_radius,
    )


def _grid(end: float, knots: FloatArray) -> FloatArray:
    last = max(end, float(knots.max(initial=0.0))) + 1.0
    return np.union1d(np.arange(0.0, last, _GRID_STEP), knots)
