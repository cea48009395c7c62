"""Closed-form lay of a sticking cable along measured inputs: the cheap stand-in of the rod."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.identification.tracked_run import IdentificationError, TrackedRun
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.material_law import TABLE_HIGH, MaterialLaw
from winding_core.lay.guide_path import lay_of
from winding_core.machine.readings import GuidePlace
from winding_core.run_inputs import Inputs, continued_inputs

# Straight pieces between them are exact to 1e-5 of the stretch.
_STRETCHES = 1000
_LOWEST_STRETCH = 0.7
# The solver's tables end at a stretch of 4; a little room keeps a noisy load cell inside.
_TABLE_SHARE = 0.98


def lay(run: TrackedRun, law: MaterialLaw) -> tuple[FloatArray, FloatArray]:
    """Return (theta [rad], z [m]) of the run's markers by the closed form, shape (m,) each.

    Cable lands with the stretch of the span's tension F less EI l / (2 rho^2) for bending,
    where the fleet-angle law dz/dtheta = (z_guide - z) rho / L puts it, and sticks. Inertia,
    contact's depth and the chords of elements are what the rod adds.

    Raises:
        IdentificationError: The last marker does not land within the run.
    """
    config, case = run.config, run.config.case
    longest = float(run.readings.ids[-1]) * case.marker_spacing
    top = _stretch_at(law, np.array([run.highest_tension]) / case.axial_area)[0]
    reach = 1.05 * longest * top / case.cylinder_radius + 0.5
    inputs, span = turning(continued_inputs(run.inputs, reach), config)
    theta = inputs["cylinder_angle"]
    pull = run.tensions(inputs)
    stretch = _stretch_at(law, pull / case.axial_area)
    radius = _radius(config, law, stretch)
    bending = case.bending_stiffness * law.young / case.material.young
    bent = 0.5 * bending * stretch / radius**2
    stretch = _stretch_at(law, (pull - bent) / case.axial_area)
    radius = _radius(config, law, stretch)
    step = np.diff(theta)
    lag = 0.5 * (span[1:] + span[:-1]) / case.centreline_radius
    z = lay_of(theta, inputs["carriage_position"], lag)
    slope = np.gradient(z, theta)
    reference = np.hypot(radius, slope) / stretch
    laid = np.concatenate([[0.0], np.cumsum(0.5 * (reference[1:] + reference[:-1]) * step)])
    arc = run.readings.ids * case.marker_spacing
    if laid[-1] < arc[-1]:
        raise IdentificationError(
            f"P{run.readings.ids[-1]} does not land within the run: "
            f"{laid[-1]:.4g} m of {arc[-1]:.4g} m are wound"
        )
    marker_theta = np.interp(arc, laid, theta)
    return marker_theta, np.interp(marker_theta, theta, z)


def strain(run: TrackedRun, law: MaterialLaw) -> float:
    """Return the strain of the span under the run's mean tension."""
    stress = run.tensions(run.inputs).mean() / run.config.case.axial_area
    return float(_stretch_at(law, np.array([stress]))[0]) - 1.0


def softest_young(run: TrackedRun, law: str) -> float:
    """Return the smallest Young's modulus [Pa] with which a law carries the greatest tension."""
    _, stress, _ = unit_law(replace(run.config.resolved.law, law=law))
    return run.highest_tension / run.config.case.axial_area / (_TABLE_SHARE * float(stress[-1]))


def _stretch_at(law: MaterialLaw, stress: FloatArray) -> FloatArray:
    stretch, unit_stress, _ = unit_law(law)
    return np.interp(stress / law.young, unit_stress, stretch)


def _radius(config: WindingConfig, law: MaterialLaw, stretch: FloatArray) -> FloatArray:
    case = config.case
    # As WindingConfig.thins, for the law that is tried.
    thins = law.law != "linear" if config.thinning is None else config.thinning
    if not thins:
        return np.full_like(stretch, case.centreline_radius)
    grid, _, lateral = unit_law(law)
    return np.asarray(case.cylinder_radius + case.cable_radius * np.interp(stretch, grid, lateral))


def unit_law(law: MaterialLaw) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (stretch, nominal stress over E, lateral stretch) up to the law's limit, (k,) each."""
    return _tabulated(law.material_law(1.0, law.poisson))


@lru_cache(maxsize=64)
def _tabulated(bar: MaterialLaw) -> tuple[FloatArray, FloatArray, FloatArray]:
    stretch = np.linspace(_LOWEST_STRETCH, min(bar.limit()[1], TABLE_HIGH), _STRETCHES)
    return stretch, bar.nominal_stress(stretch), bar.lateral_stretch(stretch)


def turning(inputs: Inputs, config: WindingConfig) -> tuple[Inputs, FloatArray]:
    """Keep the samples at which more cable is wound than ever before.

    Returns:
        Inputs whose cylinder angle counts from where the cable lands, shape (n,), and the free
        length at each [m].
    """
    radius, moved = config.case.centreline_radius, ~np.isnan(inputs["guide_x"])
    span, angle = np.full(inputs.size, config.free_length), inputs["cylinder_angle"].copy()
    for k in np.flatnonzero(moved):
        guide = GuidePlace(x=float(inputs["guide_x"][k]), y=float(inputs["guide_y"][k]))
        span[k] = guide.free_length(radius)
        angle[k] -= guide.landing(radius)
    before = np.concatenate([[-np.inf], np.maximum.accumulate(angle)[:-1]])
    kept = angle > before + 1.0e-9
    wound = inputs[kept].copy()
    wound["cylinder_angle"] = angle[kept]
    return wound, span[kept]


def landed_z(lag: FloatArray, guide: FloatArray, step: float) -> FloatArray:
    """Return z [m] of many cables: dz/dtheta = (guide - z) / lag, exact for straight pieces.

    Args:
        lag: Free length over radius [rad], shape (n, k).
        guide: Of the guide [m], shape (n, k).
        step: Between two wound angles [rad].
    """
    middle = 0.5 * (lag[:, 1:] + lag[:, :-1])
    behind = middle * (np.diff(guide, axis=1) / step)
    decay = np.exp(-step / middle)
    # z[i + 1] = decay z[i] + what the guide adds.
    added = guide[:, 1:] - behind - decay * (guide[:, :-1] - behind)
    z = np.zeros_like(lag)
    for i in range(lag.shape[1] - 1):
        z[:, i + 1] = decay[:, i] * z[:, i] + added[:, i]
    return z
