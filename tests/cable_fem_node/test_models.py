"""The general models: forces are slopes of energies, convergence, restart, refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cable_fem_node.dynamics.failure import DivergenceError
from cable_fem_node.dynamics.surroundings import CylinderContact
from cable_fem_node.rod.rod import Rod
from cable_fem_node.rod.rod_section import RodSection
from cable_fem_node.rod.statics import equilibrium
from cable_fem_node.solid.solid import Solid
from cable_fem_node.solid.solid_law import SolidLaw
from cable_fem_node.solid.solid_mesh import block, round_bar
from cable_fem_node.verification.rod_statics import line

SECTION = RodSection(diameter=4.0e-3, law="neo_hookean")


def wavy(count, seed):
    rng = np.random.default_rng(seed)
    nodes = line(0.05, count)
    return nodes + 1.0e-3 * rng.standard_normal(nodes.shape)


def assert_forces_are_slopes(model, tolerance):
    forces = model.internal_forces()
    start = model.nodes
    step = 1.0e-8
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
    model.set_nodes(start)
    assert -forces == pytest.approx(slope, abs=tolerance * np.abs(forces).max())


def test_rod_forces_are_slopes_of_its_energy():
    rod = Rod(line(0.05, 8), SECTION)
    rod.clamp("start")
    rod.set_nodes(wavy(8, 1))
    # Rounding of the energy over the step of 1e-8 m.
    assert_forces_are_slopes(rod, 1e-4)


def test_framed_rod_forces_are_slopes_of_its_energy():
    rod = Rod(wavy(8, 2), SECTION, twist=True, curved=True)
    rod.clamp("start")
    rod.set_nodes(wavy(8, 3))
    rod.internal_forces()
    rod.spin_angles[:] = np.linspace(0.0, 0.8, 8)
    assert_forces_are_slopes(rod, 1e-4)


@pytest.mark.parametrize("law", ["linear", "hencky", "neo_hookean", "mooney_rivlin"])
def test_solid_forces_are_slopes_of_its_energy(law):
    nodes, hexes = block([2.0e-3, 1.0e-3, 1.0e-3], (2, 1, 1))
    solid = Solid(nodes, hexes, SolidLaw(law=law))
    rng = np.random.default_rng(5)
    solid.set_nodes(nodes + 1.0e-4 * rng.standard_normal(nodes.shape))
    assert_forces_are_slopes(solid, 1e-5)


def test_tip_deflection_converges_at_second_order():
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


def test_hourglass_control_is_active():
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


def test_solid_conserves_momentum_and_energy():
    mesh = round_bar(4.0e-3, np.linspace(0.0, 0.02, 6))
    solid = Solid(mesh.nodes, mesh.hexes, SolidLaw(law="neo_hookean"), bulk_viscosity=0.0)
    velocity = np.cross([3.0, 0.0, 40.0], mesh.nodes) + np.array([0.1, -0.2, 0.3])
    velocity[:, 0] += 2.0 * np.sin(math.pi * mesh.nodes[:, 2] / 0.02)
    solid.set_velocities(velocity)

    def momenta():
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


def test_contact_holds_a_pressed_block():
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


def test_solid_run_fails_loudly_on_a_negative_jacobian():
    nodes, hexes = block([1.0e-3] * 3, (1, 1, 1))
    solid = Solid(nodes, hexes, SolidLaw())
    solid.fix(range(4))
    solid.set_velocities(np.where(nodes[:, 2:] > 0.0, [0.0, 0.0, -500.0], 0.0))
    solid.release(range(4))
    solid.fix(np.flatnonzero(nodes[:, 2] == 0.0))
    with pytest.raises(DivergenceError, match=r"element 0: negative Jacobian"):
        solid.advance(1.0e-4)


def test_step_above_the_stable_range_is_refused():
    rod = Rod(line(0.05, 10), SECTION)
    with pytest.raises(ValueError, match="to be stable"):
        rod.advance(1.0, step=1.0)


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
    ],
)
def test_invalid_models_are_refused(build, words):
    with pytest.raises(ValueError, match=words):
        build()
