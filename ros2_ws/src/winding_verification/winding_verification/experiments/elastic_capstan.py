"""A stiff rod on a capstan: what it holds at one end over what it is pulled with at the other."""

import csv
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from cable_fem_node.dynamics.state import CylinderContact, SolverError
from cable_fem_node.winding.resolved_model import chord_radius
from winding_verification.experiments.scenario import ExternalFileError, ExternalRow
from winding_verification.rod.rod import Rod, RodSection

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
    line through its speeds is extrapolated to zero.

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


NAME = "elastic_capstan"
TABLE = "elastic_capstan.csv"
LIMITS = {
    "friction": (0.0, 2.0),
    "wrap_angle_rad": (0.1, 4.0 * math.pi),
    "stiffness": (1.0e-4, 1.0),
    "force_ratio": (0.5, 50.0),
}
_BAR = 2.0e-2  # What a table read off a figure allows; the rod is within 0.6 % of the closed form


@dataclass(frozen=True, kw_only=True)
class CapstanPoint:
    """One point of the table."""

    friction: float  # Coulomb's coefficient
    wrap_angle_rad: float  # Angle between the two pulls [rad]
    stiffness: float  # EI / (F R^2), F the light pull, R the radius of the rod's centreline
    force_ratio: float  # Strong over light pull when it begins to slide


def read_table(file: Path) -> list[CapstanPoint]:
    """Return the points of a table.

    Raises:
        ExternalFileError: It is not one; names the line, the value and the limit.
    """
    try:
        with file.open(newline="", encoding="utf-8") as stream:
            rows = list(csv.DictReader(stream))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ExternalFileError(f"{file} cannot be read: {error}") from error
    points = [_point(f"{file}, line {line}", row) for line, row in enumerate(rows, 2)]
    if not points:
        raise ExternalFileError(f"{file} has no line under its columns {', '.join(LIMITS)}")
    return points


def compare_points(points: Sequence[CapstanPoint]) -> Iterator[ExternalRow]:
    """Let this rod slide at every point of a table; yield how far off its ratio is.

    Raises:
        SolverError: The rod does not slide.
    """
    for point in points:
        at = (point.friction, point.wrap_angle_rad, point.stiffness)
        yield ExternalRow(
            experiment=NAME,
            variant="friction {:g}, wrap {:g} rad, stiffness {:g}".format(*at),
            quantity="force_ratio_error",
            computed=slipping_ratio(*at) / point.force_ratio - 1.0,
            bar=_BAR,
            published={"closed form": limiting_ratio(*at) / point.force_ratio - 1.0},
        )


def _point(place: str, row: dict[str, str]) -> CapstanPoint:
    values = {}
    for name, (least, most) in LIMITS.items():
        text = row.get(name)
        try:
            value = float(text or "")
        except ValueError:
            raise ExternalFileError(f"{place}: {name} must be a number, got {text!r}") from None
        if not least <= value <= most:
            raise ExternalFileError(
                f"{place}: {name} must lie in [{least:g}, {most:g}], got {text}"
            )
        values[name] = value
    point = CapstanPoint(**values)
    if point.wrap_angle_rad <= 2.0 * lift_off(point.stiffness):
        raise ExternalFileError(
            f"{place}: a rod of stiffness {point.stiffness:g} wrapped by "
            f"{point.wrap_angle_rad:g} rad does not lie on the capstan"
        )
    return point
