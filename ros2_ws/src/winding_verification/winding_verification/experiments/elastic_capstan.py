"""A stiff rod on a capstan: what it holds at one end over what it is pulled with at the other."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

from cable_fem_node.dynamics.state import CylinderContact, SolverError
from cable_fem_node.winding.resolved_model import chord_radius
from winding_verification.rod.rod import Rod
from winding_verification.rod.rod_section import RodSection

_RADIUS, _PULL = 0.03, 1.0  # [m], [N]; everything is counted in them
_ELEMENT = 0.04  # [rad]
_AXIAL = 1.0e3  # EA over the light end's pull
_BY_LENGTH = 0.01  # [kg/m]
_DAMPING = 200.0  # [1/s] near the critical one of the tails
_SETTLING, _RAMP, _SAMPLE = 0.1, 0.5, 2.0e-3  # [s]
_SLOW, _FAST = 0.02, 0.1  # [m/s] of a rod that slides, and not yet far
_MOST = 3.0  # times the ramp, after which it ought to have slid


def lift_off(stiffness: float) -> float:
    """Return the angle [rad] by which a tail turns from where it leaves the capstan to its end.

    The elastica's first integral, EI kappa^2 / 2 = F (1 - cos(angle)), with the capstan's
    curvature where the tail leaves it.

    Args:
        stiffness: EI / (F R^2) of its pull F [1].
    """
    return math.acos(max(1.0 - 0.5 * stiffness, -1.0))


def limiting_ratio(friction: float, wrap: float, stiffness: float) -> float:
    """Return the greatest pull at the strong end over that at the light one.

    On the arc the bending moment is the same everywhere, no shear is left, and the tension grows by
    exp(mu angle). A tail that leaves the arc at an angle to its pull has a shear there, F sin,
    which presses on the capstan in one point and is held by friction as well.

    Args:
        friction: Coulomb's coefficient mu [1].
        wrap: Angle between the pulls' directions [rad], tails and arc together.
        stiffness: EI / (F R^2) of the light end's pull, R of the rod's centreline [1].
    """
    light = lift_off(stiffness)
    begin = math.cos(light) + friction * math.sin(light)

    def excess(ratio: float) -> float:
        strong = lift_off(stiffness / ratio)
        held = begin * math.exp(friction * (wrap - light - strong))
        return ratio * (math.cos(strong) - friction * math.sin(strong)) - held

    highest = 10.0 * math.exp(friction * wrap) + 10.0
    return float(brentq(excess, 1.0, highest))


def slipping_ratio(friction: float, wrap: float, stiffness: float) -> float:
    """Return the same of this project's rod: the strong end's pull is raised until it slides.

    A damped rod that slides is faster in proportion to what it is pulled with beyond the limit; the
    line through its speeds tells where they would be zero.

    Args:
        friction: Coulomb's coefficient mu [1].
        wrap: Angle between the pulls' directions [rad].
        stiffness: EI / (F R^2) of the light end's pull, R of the rod's centreline [1].

    Raises:
        SolverError: It does not slide.
    """
    expected = limiting_ratio(friction, wrap, stiffness)
    bending = stiffness * _PULL * _RADIUS**2
    axial = _AXIAL * _PULL
    diameter = 4.0 * math.sqrt(bending / axial)
    area = 0.25 * math.pi * diameter**2
    section = RodSection(diameter=diameter, young=axial / area, density=_BY_LENGTH / area)
    count = math.ceil(wrap / _ELEMENT)
    spacing = wrap / count * _RADIUS
    tail = math.ceil(_RADIUS * max(3.0, 6.0 * math.sqrt(stiffness)) / spacing)
    angle = np.linspace(0.0, wrap, count + 1)
    reach = chord_radius(_RADIUS, spacing)
    arc = reach * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    first = np.array([0.0, -1.0, 0.0])
    last = np.array([-math.sin(wrap), math.cos(wrap), 0.0])
    steps = spacing * np.arange(1, tail + 1)[:, None]
    nodes = np.concatenate([arc[0] + steps[::-1] * first, arc, arc[-1] + steps * last])
    rod = Rod(nodes, section, reference=np.full(nodes.shape[0] - 1, spacing))
    rod.touch(CylinderContact(reach=reach, friction=friction))
    rod.damping_rate = _DAMPING
    rod.apply(0, _PULL * first)
    rod.apply(nodes.shape[0] - 1, _PULL * last)
    rod.advance(_SETTLING)
    pulls: list[float] = []
    speeds: list[float] = []
    while not speeds or speeds[-1] < _FAST:
        share = (rod.time - _SETTLING) / _RAMP
        if share > _MOST:
            raise SolverError(
                f"a rod with friction {friction:g}, wrap {wrap:g} rad and stiffness "
                f"{stiffness:g} does not slide under {pulls[-1]:.3g} times the light pull"
            )
        pull = _PULL * (1.0 + share * (1.2 * expected - 1.0))
        rod.load[:, -1] = pull * last
        rod.advance(_SAMPLE)
        pulls.append(pull)
        speeds.append(float(rod.velocities[-1] @ last))
    v, f = np.array(speeds), np.array(pulls)
    begun = np.flatnonzero(v < _SLOW)[-1] + 1
    _, start = np.polyfit(v[begun:], f[begun:], 1)
    return float(start) / _PULL
