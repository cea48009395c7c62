"""From a winding configuration to the kernel's constants, stable step and empty arrays."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.winding.winding_config import WindingConfig
from cable_fem_node.winding.winding_state import (
    ANGLE,
    FEED,
    GUIDE,
    LANDING,
    MERGE_AT,
    SPEED,
    STRETCH,
    TENSION,
    Constants,
    Work,
)
from winding_core.material_law import TABLE_HIGH, TABLE_INTERVALS, TABLE_LOW, MaterialLaw

FloatArray = NDArray[np.float64]

# Share of the critical step that is taken; the rest covers damping and large rotations.
STEP_SAFETY = 0.8

# Points of the table of stretch and landing radius over tension: errors below 1e-6.
RESPONSE_POINTS = 4001

# The contact spring is six times as stiff as a segment, or stiffer where the cable would sink in
# by more than this share of the radius.
SINK_SHARE = 0.005


def chord_radius(radius: float, length: float) -> float:
    """Return the radius of nodes whose chords are as long as the arcs of the circle [m]."""
    half = 0.5 * length / radius
    return radius * half / math.sin(half)


def constants_of(config: WindingConfig, law: MaterialLaw) -> Constants:
    """Return the kernel's constants."""
    case = config.case
    h, area = config.segment_length, case.section_area
    tension = config.weight_tension
    stretch = law.stretch_at(tension / area)
    radius = config.wound_radius(stretch)
    mass = config.mass_scaling * case.material.density * area * h
    axial = case.material.young * area / h
    normal = max(6.0 * axial, tension * stretch * h / (SINK_SHARE * radius**2))
    stick = 0.25 * normal
    wave = math.sqrt(case.material.young / (config.mass_scaling * case.material.density))
    first_mode = 0.5 * math.pi * wave / config.free_length
    shear = law.shear_modulus
    polar = 0.5 * math.pi * case.cable_radius**4
    return Constants(
        segment=h,
        mass=mass,
        area=area,
        bending=config.bending_stiffness,
        table_low=TABLE_LOW,
        table_per_spacing=TABLE_INTERVALS / (TABLE_HIGH - TABLE_LOW),
        normal_stiffness=normal,
        normal_damping=0.4 * math.sqrt(normal * mass),
        stick_stiffness=stick,
        stick_damping=0.2 * math.sqrt(stick * mass),
        friction=config.friction,
        damping_rate=2.0 * config.damping_ratio * first_mode,
        start_radius=chord_radius(radius, stretch * h),
        contact_line=radius,
        free_length=config.free_length,
        cable_radius=case.cable_radius,
        roll_inertia=0.5 * mass * case.cable_radius**2,
        torsion=shear * polar,
    )


def responses_of(
    config: WindingConfig, law: MaterialLaw, k: Constants
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return tensions [N] up to the law's limit, their stretches and landing radii [m].

    Tabulated, because a measured tension changes a thousand times a second.
    """
    highest = min(law.limit()[1], TABLE_HIGH)
    stretch = np.linspace(0.8, highest, RESPONSE_POINTS)
    tension = k.area * law.nominal_stress(stretch)
    lateral = law.lateral_stretch(stretch) if config.thins else np.ones_like(stretch)
    radius = config.case.cylinder_radius + config.case.cable_radius * np.maximum(lateral, 0.1)
    length = stretch * k.segment
    wound = np.maximum(tension - 0.5 * k.bending * stretch / radius**2, 0.0)
    half = np.minimum(0.5 * length / radius, 1.5)
    landing = radius * half / np.sin(half) + wound * length / radius / k.normal_stiffness
    return tension, stretch, landing


def stable_step(config: WindingConfig, law: MaterialLaw, k: Constants) -> float:
    """Return the step [s]: a share of 2 / omega of the stiffest axial and transverse motion."""
    tension = 2.0 * config.weight_tension
    stretch = law.stretch_at(0.5 * tension / k.area)
    tangent = max(law.tangent(1.0), law.tangent(stretch))
    along = 4.0 * tangent * k.area / k.segment + k.stick_stiffness
    short = 0.5 * (1.0 + MERGE_AT)
    across = (
        k.normal_stiffness
        + 16.0 * k.bending / (short * k.segment**3)
        + 4.0 * tension / (stretch * k.segment)
    )
    return STEP_SAFETY * 2.0 * math.sqrt(k.mass / max(along, across))


def part_way(drive: FloatArray, u: float, span: float) -> FloatArray:
    """Return the drive with its first column moved to the share u of the way."""
    part = drive.copy()
    for value, slope in ((ANGLE, SPEED), (GUIDE, FEED)):
        a, b = drive[value]
        da, db = drive[slope] * span
        step = b - a
        second, third = 3.0 * step - 2.0 * da - db, da + db - 2.0 * step
        part[value, 0] = a + u * (da + u * (second + u * third))
        part[slope, 0] = (da + u * (2.0 * second + 3.0 * u * third)) / span
    for value in (TENSION, STRETCH, LANDING):
        part[value, 0] = drive[value, 0] + u * (drive[value, 1] - drive[value, 0])
    return part


def empty_work(capacity: int) -> Work:
    """Return scratch arrays for so many nodes."""
    return Work(
        tangent=np.zeros((3, capacity)),
        inverse=np.zeros(capacity),
        tension=np.zeros(capacity),
        cosine=np.zeros(capacity),
        slope=np.zeros(capacity),
        force=np.zeros((3, capacity)),
        net=np.zeros((3, capacity)),
        couple=np.zeros(capacity),
    )
