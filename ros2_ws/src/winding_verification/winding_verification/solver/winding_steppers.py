"""Problems with closed forms posed to the steppers that wind the rod and the solid.

Zero turning, steps of the tension, a guide that jumps: the same entry points, kernels and
constants as in a run, so that a wrong coefficient in them shows here.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.solid.hex_geometry import hex_geometry
from cable_fem_node.solid.solid_mesh import round_bar
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.solid_winding import RIM_NODES, SolidWinding
from cable_fem_node.winding.winding_config import WindingConfig
from cable_fem_node.winding.winding_model import WindingModel
from winding_core.cable.cases import Case, Material
from winding_core.machine.readings import AxisReading
from winding_verification.solver.suite import Values

ROUNDS = 12  # Rounds of Gauss and Newton; five would do
LIMP = 1.0e-3  # Factor on the bending stiffness of a cable that only pulls
# Hourglass stiffness as a share of the shear modulus, as `Solid` documents it.
HOURGLASS = 0.1
SOLID_CASE = Case(cylinder_diameter=0.1, cable_diameter=2.0e-3, weight=0.5, marker_spacing=0.1)


@dataclass(eq=False)
class Machine:
    """Moves cylinder, guide and load of a winding model from one standstill to the next."""

    model: WindingModel  # At its start
    tension: float  # Of the span [N]
    piece: float = 5.0e-3  # Time between two calls of the model [s]

    def __post_init__(self) -> None:
        self._angle = 0.0
        self._guide = 0.0

    def move(
        self,
        seconds: float,
        *,
        angle: float | None = None,
        guide: float | None = None,
        tension: float | None = None,
    ) -> None:
        """Move to an angle [rad], a place of the guide [m] and a tension [N]; None stays."""
        a, g, f = self._angle, self._guide, self.tension
        da = 0.0 if angle is None else angle - a
        dg = 0.0 if guide is None else guide - g
        df = 0.0 if tension is None else tension - f
        start, pieces = self.model.time, math.ceil(seconds / self.piece)
        for i in range(1, pieces + 1):
            u = i / pieces
            way, rate = u * u * (3.0 - 2.0 * u), 6.0 * u * (1.0 - u) / seconds
            reading = AxisReading(
                cylinder_angle=a + way * da,
                angular_speed=rate * da,
                carriage_position=g + way * dg,
                feed_speed=rate * dg,
            )
            self.model.advance_to(start + u * seconds, reading, f + way * df)
        self._angle, self._guide, self.tension = a + da, g + dg, f + df

    def spin(self, seconds: float, speed: float, to: float | None = None) -> None:
        """Turn on at a speed [rad/s] that changes steadily to another one."""
        change = (speed if to is None else to) - speed
        a, start, pieces = self._angle, self.model.time, math.ceil(seconds / self.piece)
        for i in range(1, pieces + 1):
            t = seconds * i / pieces
            self._angle = a + speed * t + 0.5 * change * t * t / seconds
            reading = AxisReading(
                cylinder_angle=self._angle,
                angular_speed=speed + change * t / seconds,
                carriage_position=self._guide,
                feed_speed=0.0,
            )
            self.model.advance_to(start + t, reading, self.tension)

    def watch(self, seconds: float, pieces: int, look: Callable[[], Any]) -> FloatArray:
        """Stand still and return what is seen at equal times, shape (pieces, ...)."""
        seen = []
        for _ in range(pieces):
            self.move(seconds / pieces)
            seen.append(look())
        return np.asarray(seen)


def swing(values: FloatArray, spacing: float) -> tuple[float, float, float]:
    """Return period [s], logarithmic decrement and rest of a decaying oscillation.

    The damped sine about a constant that fits best, by Gauss and Newton. Not a number where
    it hardly swings.

    Args:
        values: Displacement at equal times, shape (n,).
        spacing: Time between them [s].
    """
    off = values - values.mean()
    rises = np.flatnonzero((off[:-1] < 0.0) & (off[1:] >= 0.0))
    if rises.size < 3:
        return math.nan, math.nan, math.nan
    t = spacing * np.arange(values.size)
    decay, omega, rest = 0.0, math.tau / (spacing * float(np.diff(rises).mean())), 0.0
    for _ in range(ROUNDS):
        wave = np.exp(-decay * t) * np.stack([np.cos(omega * t), np.sin(omega * t)])
        columns = np.column_stack([*wave, *(t * wave), np.ones_like(t)])
        (a, b, c, d, rest), *_ = np.linalg.lstsq(columns, values, rcond=None)
        square = a * a + b * b
        decay -= (a * c + b * d) / square
        omega += (b * c - a * d) / square
        if not (omega > 0.0 and abs(decay) < omega):
            return math.nan, math.nan, math.nan
    return float(math.tau / omega), float(math.tau * decay / omega), float(rest)


def longitudinal() -> Values:
    """V01: the span's first axial mode after a small step of the tension."""
    case = _cable(4.0e-3, 1.0, cylinder=0.03)
    model = RodWinding(WindingConfig(case=case, damping_ratio=0.02, segment_length=2.0e-3))
    machine = Machine(model, 1.0, 1.0e-4)
    machine.move(1.0e-4, tension=1.1)

    def first_mode() -> float:
        # Looked up each time: the last element is cut where it has grown.
        arc, tension = model.cable()["s"], model.tension()[:-1]
        shape = np.cos(0.25 * math.pi * (arc[1:-1] + arc[:-2]) / arc[-1])
        return float(shape @ tension / shape.sum())

    seen = machine.watch(0.1, 500, first_mode)
    period, decrement, rest = swing(seen, 0.1 / 500)
    balance = model.energy.balance_pct
    return {"period": period, "decrement": decrement, "rest": rest, "balance_pct": balance}


def transverse() -> Values:
    """V02: a limp span after the guide has jumped aside: a string."""
    case = _cable(4.0e-3, 1.0, cylinder=0.03, bending=LIMP)
    config = WindingConfig(case=case, damping_ratio=0.005, segment_length=4.0e-3)
    return {"period": _pluck(config, jump=1.0e-3, seconds=2.0e-3, watched=0.25)}


def bending() -> Values:
    """V03: a stiff span between cylinder and guide, after a jump of the guide."""
    case = _cable(4.0e-3, 2.0, cylinder=0.3, young=2.6e9)
    config = WindingConfig(case=case, damping_ratio=1.0e-4, segment_length=2.0e-3, free_length=0.1)
    return {"period": _pluck(config, jump=1.0e-4, seconds=5.0e-4, watched=0.016)}


def capstan() -> Values:
    """V04: the span's tension is doubled and halved after winding; slip runs into the turns."""
    values: Values = {}
    for name, laid, then in (("raised", 1.0, 2.0), ("lowered", 2.0, 1.0)):
        case = _cable(2.0e-3, laid, cylinder=0.06, bending=LIMP, young=20.0e6)
        config = WindingConfig(case=case, friction=0.3, segment_length=4.0e-3, rests=False)
        model = RodWinding(config)
        machine = Machine(model, laid)
        machine.move(1.5, angle=4.5)
        machine.move(0.1)
        machine.move(0.4, tension=then)
        machine.move(0.1)
        behind, tension = _wound(model)
        for angle in (0.5, 1.0, 1.5, 2.0, 3.5):
            values[f"{name}_{angle:g}"] = float(np.interp(angle, behind[::-1], tension[::-1]))
        values[f"balance_pct_{name}"] = model.energy.balance_pct
    return values


def contact() -> Values:
    """V05: a frictionless cable of known tension presses on the cylinder, and sinks in."""
    case = _cable(2.0e-3, 1.0, cylinder=0.06, bending=LIMP, young=20.0e6)
    model = RodWinding(WindingConfig(case=case, friction=0.0, rests=False))
    machine = Machine(model, 1.0)
    machine.move(1.0, angle=2.5)
    machine.move(0.2)
    inside = slice(4, 12)
    before = _radius(model)[inside].mean()
    machine.move(0.5, tension=2.0)
    machine.move(0.2)
    return {
        "line_load": float(_line_load(model)[inside].mean()),
        "sink_per_newton": float(before - _radius(model)[inside].mean()),
    }


def lift_off() -> Values:
    """V06: where stiff cables leave the cylinder."""
    conditions = (
        (0.06, 4.0e-3, 2.6e6, 0.322214631),
        (0.06, 4.0e-3, 2.6e6, 0.0799622212),
        (0.06, 4.0e-3, 2.6e6, 0.0319379898),
        (0.06, 4.0e-3, 2.6e6, 0.0199539292),
        (0.03, 6.0e-3, 2.6e6, 2.64436216),
        (0.2, 3.0e-3, 2.0e9, 1.28659275),
    )
    values: Values = {}
    for number, (cylinder, diameter, young, tension) in enumerate(conditions, start=1):
        case = _cable(diameter, tension, cylinder=cylinder, young=young)
        # Shorter than the length over which bending decays.
        segment = 0.07 * case.centreline_radius
        model = RodWinding(WindingConfig(case=case, friction=0.3, segment_length=segment))
        machine = Machine(model, tension)
        machine.spin(0.5, 0.0, 2.0)
        machine.spin(0.75, 2.0)
        seen = []
        for _ in range(21):
            # Three elements land meanwhile.
            machine.spin(0.005, 2.0)
            seen.append(model.lift_off())
        values[f"azimuth_{number}"] = float(np.mean(seen))
    return values


def ring() -> Values:
    """V07: turns that lie still are spun up with the cylinder until they press with half."""
    case = _cable(2.0e-3, 1.0, cylinder=0.06, bending=LIMP, young=20.0e6)
    values: Values = {}
    config = WindingConfig(case=case, friction=0.3, mass_scaling=20.0, rests=False)
    model = RodWinding(config)
    machine = Machine(model, 1.0)
    # The guide stands aside, so that no turn comes to lie on another one.
    machine.move(0.1, guide=15.0e-3)
    machine.move(1.5, angle=4.5)
    machine.move(0.1)
    inside = slice(8, 20)
    for speed in (0.0, 50.0):
        machine.spin(0.4, 0.0, speed)
        values[f"tension_{speed:g}"] = float(model.tension()[inside].mean())
        values[f"line_load_{speed:g}"] = float(_line_load(model)[inside].mean())
    return values


def lag() -> Values:
    """V08: the wound cable follows a guide that stands aside, by the fleet-angle law."""
    case = _cable(2.0e-3, 1.0, cylinder=0.06, bending=LIMP, young=20.0e6)
    config = WindingConfig(case=case, friction=0.3, free_length=0.062)
    model = RodWinding(config)
    machine = Machine(model, 1.0)
    machine.move(0.1, guide=5.0e-3)
    machine.move(0.1)
    machine.move(2.0, angle=5.0)
    _, theta, z = model.wound_path()
    return {f"z_{angle:g}": float(np.interp(angle, theta, z)) for angle in (1.0, 2.0, 3.0, 4.0)}


def _cable(
    diameter: float, tension: float, *, cylinder: float, young: float = 2.6e6, bending: float = 1.0
) -> Case:
    return Case(
        cylinder_diameter=cylinder,
        cable_diameter=diameter,
        weight=tension,
        marker_spacing=0.1,
        material=Material(young=young, bending_factor=bending),
    )


def _pluck(config: WindingConfig, *, jump: float, seconds: float, watched: float) -> float:
    """Return the period [s] of the first mode of a span whose guide has jumped aside."""
    model = RodWinding(config)
    machine = Machine(model, config.case.weight, 0.1 * seconds)
    machine.move(seconds, guide=jump)

    def aside() -> float:
        cable = model.cable()
        along = -cable["y"] / config.free_length
        return float(np.sin(math.pi * along) @ (cable["z"] - jump * along))

    seen = machine.watch(watched, 500, aside)
    return swing(seen, watched / 500)[0]


def _wound(model: RodWinding) -> tuple[FloatArray, FloatArray]:
    """Return angle behind the contact line [rad] and tension [N] of the laid elements."""
    _, theta, _ = model.wound_path()
    behind = model.cylinder_angle - 0.5 * (theta[1:] + theta[:-1])
    return behind, model.tension()[: theta.size - 1]


def _radius(model: RodWinding) -> FloatArray:
    cable = model.cable()
    return np.asarray(np.hypot(cable["x"], cable["y"]))


def _line_load(model: RodWinding) -> FloatArray:
    """Return the cylinder's push on the inner nodes per present length [N/m], from node 0 on."""
    cable = model.cable()
    length = model.stretch() * np.diff(cable["s"])
    shares = np.zeros(cable.size)
    shares[:-1] += 0.5 * length
    shares[1:] += 0.5 * length
    return np.asarray(model.contact_forces() / shares)


def solid_longitudinal() -> Values:
    """V11: the first axial mode of cable that is not yet wound, after a step of the load."""
    config = WindingConfig(
        case=SOLID_CASE,
        damping_ratio=0.02,
        segment_length=5.0e-3,
        free_length=0.04,
        mass_scaling=400.0,
    )
    model = SolidWinding(config, 0.01)
    machine = Machine(model, 0.5, 1.0e-3)
    machine.move(1.0e-3, tension=0.55)
    arc = model.cable()["s"]
    shape = np.cos(0.25 * math.pi * (arc[1:] + arc[:-1]) / arc[-1])
    shape /= shape.sum()
    seen = machine.watch(0.44, 220, lambda: shape @ model.cable()["tension"][1:])
    period, decrement, rest = swing(seen, 0.44 / 220)
    return {"period": period, "decrement": decrement, "rest": rest}


def solid_capstan() -> Values:
    """V12: the load is raised until all the wound cable slips; what it does to the cylinder."""
    values: Values = {}
    for name, rolling in (("sections", False), ("nodes", True)):
        config = WindingConfig(
            case=SOLID_CASE,
            friction=0.3,
            damping_ratio=0.2,
            segment_length=8.0e-3,
            free_length=0.04,
            mass_scaling=400.0,
            rolling=rolling,
        )
        model = SolidWinding(config, 1.0)
        machine = Machine(model, 0.5, 2.0e-2)
        machine.move(0.5, angle=0.9)
        machine.move(0.5, tension=0.9)
        machine.move(0.1)
        _, theta, _ = model.wound_path()
        cable = model.cable()[: theta.size]
        tension, stretch = cable["tension"][1:], 1.0 + cable["strain"][1:]
        # Tension in the middle of elements, forces on the sections between them. P0's own section
        # holds its neighbour, too.
        middle = 0.5 * (theta[1:] + theta[:-1])
        slipping = slice(2, None)
        values[f"friction_{name}"] = float(
            np.polyfit(middle[slipping], np.log(tension[slipping]), 1)[0]
        )
        load = 0.5 * (tension[1:] + tension[:-1])
        normal = model.contact_forces()[1 : theta.size - 1]
        values[f"normal_{name}"] = float((normal / (load * np.diff(middle))).mean())
        load *= 0.5 * (stretch[1:] + stretch[:-1])
        values[f"sink_per_load_{name}"] = float((model.sink()[1 : theta.size - 1] / load).mean())
        values[f"hourglass_{name}"] = model.hourglass_energy / _hourglass_energy(model)
        values[f"balance_pct_{name}"] = model.energy.balance_pct
    return values


def solid_lag() -> Values:
    """V13: the wound cable follows a guide that stands aside, by the fleet-angle law."""
    # The springs of the contact reach out by a share of the radius, which shortens the span.
    case = Case(cylinder_diameter=0.02, cable_diameter=2.0e-3, weight=0.9, marker_spacing=0.1)
    config = WindingConfig(
        case=case,
        friction=0.3,
        damping_ratio=0.05,
        segment_length=4.0e-3,
        free_length=0.11,
        mass_scaling=200.0,
    )
    model = SolidWinding(config, 2.2)
    machine = Machine(model, 0.9, 2.0e-2)
    machine.move(0.1, guide=4.0e-3)
    machine.move(0.8, angle=2.1)
    _, theta, z = model.wound_path()
    # P0 holds the first section straight; what follows approaches the guide at a steady rate.
    free = (theta > 0.5) & (theta < 2.0)
    return {"rate": -float(np.polyfit(theta[free], np.log(4.0e-3 - z[free]), 1)[0])}


def _hourglass_energy(model: SolidWinding) -> float:
    """Return 0.1 G V b:b / 16 times the squared hourglass motions, summed over elements [J]."""
    solid = model.solid
    bar = round_bar(SOLID_CASE.cable_diameter, model.cable()["s"], rim_nodes=RIM_NODES)
    place = solid.points.position[:, solid.hexes]
    volume, gradient, gamma = hex_geometry(bar.nodes[solid.hexes])
    motion = np.einsum("mha,ima->mhi", gamma, place)
    stiffness = HOURGLASS * solid.law.shear_modulus * volume * (gradient**2).sum(axis=(1, 2)) / 8.0
    return float(0.5 * (stiffness * (motion**2).sum(axis=(1, 2))).sum())
