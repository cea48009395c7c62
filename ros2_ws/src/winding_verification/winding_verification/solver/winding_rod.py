"""Problems with closed forms posed to the stepper that winds the rod.

Zero turning, steps of the tension, a guide that jumps: the same entry points, kernels and
constants as in a run, so that a wrong coefficient in them shows here.
"""

from __future__ import annotations

import math

import numpy as np

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cases import Case, Material
from winding_verification.solver.machine import Machine, swing
from winding_verification.solver.references import Values

LIMP = 1.0e-3


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
    return {"period": period, "decrement": decrement, "rest": rest, **_balance(model)}


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
    for name, laid, then, at in (
        ("raised", 1.0, 2.0, (0.5, 1.0, 1.5, 2.0, 3.5)),
        ("lowered", 2.0, 1.0, (0.5, 1.0, 1.5, 2.0, 3.5)),
    ):
        case = _cable(2.0e-3, laid, cylinder=0.06, bending=LIMP, young=20.0e6)
        config = WindingConfig(case=case, friction=0.3, segment_length=4.0e-3, rests=False)
        model = RodWinding(config)
        machine = Machine(model, laid)
        machine.move(1.5, angle=4.5)
        machine.move(0.1)
        machine.move(0.4, tension=then)
        machine.move(0.1)
        behind, tension = _wound(model)
        for angle in at:
            values[f"{name}_{angle:g}"] = float(np.interp(angle, behind[::-1], tension[::-1]))
        values |= {f"{key}_{name}": value for key, value in _balance(model).items()}
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


def _balance(model: RodWinding) -> Values:
    return {"balance_pct": model.energy.balance_pct}
