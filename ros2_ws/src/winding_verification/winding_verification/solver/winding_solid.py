"""Problems with closed forms posed to the stepper that winds the solid."""

from __future__ import annotations

import math

import numpy as np

from cable_fem_node.solid.hex_geometry import hex_geometry
from cable_fem_node.solid.solid_mesh import round_bar
from cable_fem_node.winding.solid_winding import RIM_NODES, SolidWinding
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.cases import Case
from winding_verification.solver.machine import Machine, swing
from winding_verification.solver.references import Values

# Hourglass stiffness as a share of the shear modulus, as `Solid` documents it.
HOURGLASS = 0.1
CASE = Case(cylinder_diameter=0.1, cable_diameter=2.0e-3, weight=0.5, marker_spacing=0.1)


def longitudinal() -> Values:
    """V11: the first axial mode of cable that is not yet wound, after a step of the load."""
    config = WindingConfig(
        case=CASE, damping_ratio=0.02, segment_length=5.0e-3, free_length=0.04, mass_scaling=400.0
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


def capstan() -> Values:
    """V12: the load is raised until all the wound cable slips; what it does to the cylinder."""
    values: Values = {}
    for name, rolling in (("sections", False), ("nodes", True)):
        config = WindingConfig(
            case=CASE,
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


def lag() -> Values:
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
    bar = round_bar(CASE.cable_diameter, model.cable()["s"], rim_nodes=RIM_NODES)
    place = solid.points.position[:, solid.hexes]
    volume, gradient, gamma = hex_geometry(bar.nodes[solid.hexes])
    motion = np.einsum("mha,ima->mhi", gamma, place)
    stiffness = HOURGLASS * solid.law.shear_modulus * volume * (gradient**2).sum(axis=(1, 2)) / 8.0
    return float(0.5 * (stiffness * (motion**2).sum(axis=(1, 2))).sum())
