"""The general models: laws, forces as slopes of energies, convergence, restart, refusals.

The kernels are valid Python too: the same numbers come out with compilation disabled.
"""

from __future__ import annotations

import functools
import json
import math
import os
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm, polar

from cable_fem_node.dynamics.state import CylinderContact, DivergenceError
from cable_fem_node.rod.rod_kernels import law_energy, law_value
from cable_fem_node.rod.rod_records import axial_response
from cable_fem_node.solid.solid import Solid
from cable_fem_node.solid.solid_law import SolidLaw
from cable_fem_node.solid.solid_mesh import block, round_bar
from processes import python
from winding_core.cable.material_law import LAWS, MaterialLaw, NoEquilibriumError
from winding_verification.rod.rod import Rod, RodSection
from winding_verification.rod.statics import equilibrium, frequencies
from winding_verification.solver.rods import line

SECTION = RodSection(diameter=4.0e-3, law="neo_hookean")
# A parameter of the law's own, far from its default.
STIFFENING = {"law": "mooney_rivlin", "mooney_ratio": 5.0}
SCRIPT = """
import json
import numpy as np
from winding_verification.rod.rod import Rod
from winding_verification.rod.rod import RodSection
from cable_fem_node.solid.solid import Solid
from cable_fem_node.solid.solid_law import SolidLaw
from cable_fem_node.solid.solid_mesh import block
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.cases import paper_case
from winding_core.machine.readings import AxisReading

line = np.column_stack([np.linspace(0.0, 0.02, 5), np.zeros(5), np.zeros(5)])
rod = Rod(line, RodSection(diameter=4e-3, law="neo_hookean"), twist=True)
rod.clamp("start")
rod.apply(4, (0.0, 0.1, 0.05))
rod.advance(2e-3)
nodes, hexes = block([2e-3, 1e-3, 1e-3], (2, 1, 1))
solid = Solid(nodes, hexes, SolidLaw(law="hencky"))
solid.fix(range(4))
solid.apply(range(8, 12), (0.2, 0.1, 0.0))
solid.advance(5e-5)
model = RodWinding(WindingConfig(case=paper_case(4), segment_length=9e-3))
model.advance_to(0.03, AxisReading(
    cylinder_angle=0.02, angular_speed=0.7, carriage_position=1e-4, feed_speed=3e-3
))
print(json.dumps([rod.nodes.tolist(), solid.nodes.tolist(), model.cable()["x"].tolist(),
                  [model.energy.internal, model.energy.external, model.energy.damping]]))
"""


def wavy(count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    nodes = line(0.05, count)
    return nodes + 1.0e-3 * rng.standard_normal(nodes.shape)


def moved_rod() -> Rod:
    rod = Rod(line(0.05, 8), SECTION)
    rod.clamp("start")
    rod.set_nodes(wavy(8, 1))
    return rod


def moved_framed_rod() -> Rod:
    rod = Rod(wavy(8, 2), SECTION, twist=True, curved=True)
    rod.clamp("start")
    rod.set_nodes(wavy(8, 3))
    rod.internal_forces()
    rod.spin_angles[:] = np.linspace(0.0, 0.8, 8)
    return rod


def moved_solid(law: str) -> Solid:
    nodes, hexes = block([2.0e-3, 1.0e-3, 1.0e-3], (2, 1, 1))
    solid = Solid(nodes, hexes, SolidLaw(law=law))
    rng = np.random.default_rng(5)
    solid.set_nodes(nodes + 1.0e-4 * rng.standard_normal(nodes.shape))
    return solid


@pytest.mark.parametrize(
    ("build", "tolerance"),
    [
        # Rounding of the energy over the step of 1e-8 m.
        (moved_rod, 1e-4),
        (moved_framed_rod, 1e-4),
        *(
            (functools.partial(moved_solid, law), 1e-5)
            for law in LAWS
            # It has no stored energy.
            if law != "hencky_cauchy"
        ),
    ],
)
def test_forces_are_slopes_of_the_energy(build: Callable[[], Any], tolerance: float) -> None:
    model = build()
    forces, start, step = model.internal_forces(), model.nodes, 1.0e-8
    slope = np.zeros_like(forces)
    for i in range(start.shape[0]):
        for c in range(3):
            moved = start.copy()
            moved[i, c] += step
            model.set_nodes(moved)
            ahead = model.internal_energy()
            moved[i, c] -= 2.0 * step
            model.set_nodes(moved)
            slope[i, c] = (ahead - model.internal_energy()) / (2.0 * step)
    assert -forces == pytest.approx(slope, abs=tolerance * np.abs(forces).max())


def test_tip_deflection_converges_at_second_order() -> None:
    counts = np.array([8, 16, 32])
    exact = 0.49345748  # elastica, alpha = 2 (Bisshopp and Drucker 1945)
    errors = []
    for count in counts:
        rod = Rod(line(0.1, count), RodSection(diameter=1.0e-3))
        rod.clamp("start")
        rod.apply(count, (0.0, 2.0 * rod.section.bending / 0.01, 0.0))
        equilibrium(rod, increments=4)
        errors.append(abs(rod.nodes[-1, 1] / 0.1 / exact - 1.0))
    rates = -np.diff(np.log(errors)) / np.diff(np.log(counts))
    assert rates.min() > 1.8, f"errors {errors}"


def test_hourglass_control_is_active() -> None:
    nodes, hexes = block([1.0e-3] * 3, (1, 1, 1))
    wave = 1.0e-5 * (nodes[:, :1] - 5.0e-4) * (nodes[:, 1:2] - 5.0e-4) / 2.5e-7
    moved = nodes + wave * np.array([0.0, 0.0, 1.0])
    with_control = Solid(nodes, hexes, SolidLaw())
    without = Solid(nodes, hexes, SolidLaw(), hourglass=0.0)
    for solid in (with_control, without):
        solid.set_nodes(moved)
    # The pattern has no mean gradient: without control it costs nothing.
    assert without.internal_energy() < 1e-20
    assert with_control.hourglass_energy() > 1e-10


def test_solid_conserves_momentum_and_energy() -> None:
    mesh = round_bar(4.0e-3, np.linspace(0.0, 0.02, 6))
    solid = Solid(mesh.nodes, mesh.hexes, SolidLaw(law="neo_hookean"), bulk_viscosity=0.0)
    velocity = np.cross([3.0, 0.0, 40.0], mesh.nodes) + np.array([0.1, -0.2, 0.3])
    velocity[:, 0] += 2.0 * np.sin(math.pi * mesh.nodes[:, 2] / 0.02)
    solid.set_velocities(velocity)

    def momenta() -> tuple[np.ndarray, np.ndarray]:
        moving = solid.mass[:, None] * solid.velocities
        return moving.sum(axis=0), np.cross(solid.nodes, moving).sum(axis=0)

    linear, angular = momenta()
    solid.advance(1.0e-5)
    first = solid.energy
    solid.advance(5.0e-3)
    last = solid.energy
    linear_after, angular_after = momenta()
    assert linear_after == pytest.approx(linear, rel=1e-9)
    assert angular_after == pytest.approx(angular, rel=1e-6, abs=1e-12)
    total = first.kinetic + first.internal
    # Central differences: the bar of the suite for a rod in free flight, 0.5 %.
    assert last.kinetic + last.internal == pytest.approx(total, rel=5e-3)


def test_contact_holds_a_pressed_block() -> None:
    nodes, hexes = block([2.0e-3] * 3, (2, 2, 2))
    reach = 0.1
    solid = Solid(nodes + np.array([reach, -1.0e-3, 0.0]), hexes, SolidLaw())
    solid.touch(CylinderContact(reach=reach))
    bottom = np.flatnonzero(nodes[:, 0] == 0.0)
    top = np.flatnonzero(nodes[:, 0] > 1.9e-3)
    solid.fix(top, "yz")
    solid.apply(top, (-0.5, 0.0, 0.0))
    solid.settle(1e-4)
    assert solid.touching[bottom].all()
    assert solid.contact_forces().sum() == pytest.approx(0.5, rel=1e-3)


def test_solid_run_fails_loudly_on_a_negative_jacobian() -> None:
    nodes, hexes = block([1.0e-3] * 3, (1, 1, 1))
    solid = Solid(nodes, hexes, SolidLaw())
    solid.fix(range(4))
    solid.set_velocities(np.where(nodes[:, 2:] > 0.0, [0.0, 0.0, -500.0], 0.0))
    solid.release(range(4))
    solid.fix(np.flatnonzero(nodes[:, 2] == 0.0))
    with pytest.raises(DivergenceError, match=r"element 0: negative Jacobian"):
        solid.advance(1.0e-4)


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: Rod(line(0.1, 1), SECTION), "at least three nodes"),
        (lambda: Rod(line(0.1, 4), SECTION, curved=True), "needs twist=True"),
        (lambda: Rod(line(0.1, 4), SECTION, reference=[1.0]), "reference lengths"),
        (lambda: Solid(np.zeros((8, 3)), [range(8)], SolidLaw()), "inside out"),
        (lambda: Solid(np.eye(3), [range(8)], SolidLaw()), "name nodes outside"),
        (lambda: CylinderContact(reach=-1.0), "reach must be positive"),
        (lambda: RodSection(diameter=0.0), "diameter must be positive"),
        (lambda: MaterialLaw(law="wood"), "law must be one of"),
        (lambda: MaterialLaw(young=-1.0), "young must be positive"),
        (lambda: MaterialLaw(poisson=0.6), "poisson must lie"),
        (lambda: MaterialLaw(law="linear", incompressible=True), "incompressible applies"),
        (lambda: SolidLaw().first_piola(np.diag([1.0, 1.0, -1.0])), "determinant"),
        (lambda: Rod(line(0.05, 10), SECTION).advance(1.0, step=1.0), "to be stable"),
        (lambda: Rod(line(0.1, 6), SECTION, twist=True).aim("end", (1.0, 0.0, 0.0)),
         "a clamped end is aimed, and somewhere; got end"),
        (lambda: viscous_rod(-1.0e-3, twist=True),
         "viscosity must not be negative and needs twist"),
        (lambda: viscous_rod(1.0e-3, twist=False),
         "viscosity must not be negative and needs twist"),
    ],
)  # fmt: skip
def test_what_a_model_cannot_be_is_refused(build: Callable[[], object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        build()


def viscous_rod(viscosity: float, *, twist: bool) -> None:
    rod = Rod(line(0.1, 6), SECTION, twist=twist)
    rod.viscosity = viscosity
    rod.advance(1.0e-3)


def test_viscous_bending_decays_as_kelvin_and_voigt_have_it() -> None:
    viscosity = 0.03
    rod = Rod(line(0.3, 12), RodSection(diameter=6.0e-3, young=1.0e7, density=1.0e3), twist=True)
    rod.clamp("start")
    rod.viscosity = viscosity
    omega = 2.0 * math.pi * frequencies(rod, 1)[0]
    bow = rod.nodes
    bow[:, 1] = 1.0e-3 * (bow[:, 0] / 0.3) ** 2
    rod.set_nodes(bow)
    tip = []
    for _ in range(200):
        rod.advance(0.1 / omega)
        tip.append(rod.nodes[-1, 1])
    tops = [tip[i] for i in range(1, 199) if tip[i - 1] < tip[i] > tip[i + 1]]
    decrement = math.log(tops[1] / tops[2])
    ratio = 0.5 * viscosity * omega
    # Tops are read at the nearest of 63 samples of a swing, all alike off; measured 3e-4.
    expected = 2.0 * math.pi * ratio / math.sqrt(1.0 - ratio**2)
    assert decrement == pytest.approx(expected, rel=2.0e-3)
    energy = rod.energy
    left = energy.kinetic + energy.internal + energy.damping
    # Central differences count kinetic energy half a step off.
    assert left == pytest.approx(energy.initial, rel=0.02)


def test_placing_nodes_is_no_motion_to_viscosity() -> None:
    nodes = line(0.1, 6)
    rod = Rod(nodes, SECTION, twist=True)
    rod.clamp("start")
    rod.viscosity = 1.0e-3
    rod.advance(1.0e-3)
    rod.set_nodes(nodes + wavy(6, 4) - line(0.05, 6))
    before = rod.energy.damping
    rod.advance(1.0e-9)
    assert rod.energy.damping == pytest.approx(before, abs=1.0e-12)


def test_clamp_that_is_aimed_round_a_cone_twists_the_rod_by_the_cone_s_solid_angle() -> None:
    rod = Rod(line(0.1, 10), SECTION, twist=True)
    rod.clamp("start")
    rod.clamp("end")
    tilt = 0.3
    away = np.array([math.cos(tilt), math.sin(tilt), 0.0])
    for turned in np.linspace(0.0, 2.0 * math.pi, 200):
        swing = np.array([0.0, math.cos(turned), math.sin(turned)])
        rod.aim("start", away[0] * np.array([1.0, 0.0, 0.0]) + away[1] * swing)
        rod.internal_forces()
    rod.aim("start", (1.0, 0.0, 0.0))
    twist = rod.curvatures()[2].sum()
    # A polygon of 199 corners on the sphere for a circle: 2e-4 of its area.
    assert abs(twist) == pytest.approx(2.0 * math.pi * (1.0 - math.cos(tilt)), rel=1.0e-3)


def test_linear_law_agrees_with_the_polar_decomposition() -> None:
    rule, rng = SolidLaw(law="linear"), np.random.default_rng(3)
    for _ in range(6):
        gradient = expm(0.25 * rng.standard_normal((3, 3)))
        rotation, stretch = polar(gradient)
        strain = stretch - np.eye(3)
        stress = 2.0 * rule.shear_modulus * strain + rule.lame * np.trace(strain) * np.eye(3)
        assert rule.first_piola(gradient) == pytest.approx(rotation @ stress, rel=1e-10, abs=1e-3)


@pytest.mark.parametrize("own", [*({"law": law} for law in LAWS), STIFFENING])
def test_uniaxial_response_has_free_sides(own: dict[str, Any]) -> None:
    rule = SolidLaw.of(MaterialLaw(**own))
    for stretch in (0.8, 1.1, 1.5):
        lateral = float(rule.lateral_stretch(stretch))
        stress = rule.first_piola(np.diag([stretch, lateral, lateral]))
        # Zero against Young's modulus, to the accuracy of the lateral root.
        assert abs(stress[1, 1]) < 1e-8 * rule.young
        assert stress[0, 0] == pytest.approx(float(rule.nominal_stress(stretch)), rel=1e-8)


@pytest.mark.parametrize("law", LAWS)
def test_table_is_the_law(law: str) -> None:
    rule = MaterialLaw(law=law)
    response = axial_response(rule, 1.0)
    for stretch in np.random.default_rng(4).uniform(0.4, 3.0, 50):
        stress = law_value(stretch, response)
        energy = law_energy(stretch, response)
        # Cubic interpolation over steps of 0.002.
        assert stress == pytest.approx(float(rule.nominal_stress(stretch)), abs=1e-6 * rule.young)
        assert energy == pytest.approx(float(rule.energy_density(stretch)), abs=1e-6 * rule.young)


def test_dead_load_beyond_the_limit_is_refused() -> None:
    with pytest.raises(NoEquilibriumError, match=r"at most 0\.9565 MPa"):
        MaterialLaw(law="hencky").stretch_at(1.249e6)


def outcome(**environment: str) -> Any:
    done = python(SCRIPT, env={**os.environ, **environment}, timeout=240)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
def test_interpreted_kernels_give_the_compiled_numbers() -> None:
    numbers = outcome()
    assert numbers
    for compiled, interpreted in zip(numbers, outcome(NUMBA_DISABLE_JIT="1"), strict=True):
        # Compiled sums are reordered: rounding of a few hundred steps remains.
        assert np.asarray(interpreted) == pytest.approx(np.asarray(compiled), rel=1e-9, abs=1e-12)
