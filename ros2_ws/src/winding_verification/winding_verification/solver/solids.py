"""Solids: element tests, bars against CalculiX, hourglass control, stable step."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csc_matrix, diags
from scipy.sparse.linalg import eigsh, splu

from cable_fem_node.dynamics.state import DivergenceError, FloatArray
from cable_fem_node.solid.hex_geometry import CORNERS, HOURGLASS, hex_geometry
from cable_fem_node.solid.hex_kernels import hex_stiffness
from cable_fem_node.solid.solid import Solid
from cable_fem_node.solid.solid_law import SolidLaw
from cable_fem_node.solid.solid_mesh import BarMesh, block, round_bar, section_mesh
from winding_verification.rod.statics import balance
from winding_verification.solver.suite import Values, given, rotations, wave_record


def solid_equilibrium(solid: Solid, *, increments: int = 4, tolerance: float = 1.0e-8) -> None:
    """Move a solid to its equilibrium under its loads and gravity (no contact).

    Driven axes of nodes stay where they are.

    Raises:
        DivergenceError: No equilibrium was found.
    """
    free = _free(solid)
    size = float(np.cbrt(solid.volumes.min()))

    def take_step(net: FloatArray) -> None:
        step = splu(solid_stiffness(solid)[free][:, free]).solve(net)
        # A node may not jump over an element; rigid swings of far nodes may.
        step *= min(1.0, 20.0 * size / float(np.abs(step).max()))
        _search(solid, free, step, float(np.linalg.norm(net)))

    balance(
        (solid.load, solid.gravity),
        lambda: solid._net_forces().T.ravel()[free],
        lambda: max(solid.force_scale(), 1.0e-30),
        take_step,
        increments=increments,
        tolerance=tolerance,
        iterations=40,
    )


def solid_stiffness(solid: Solid) -> csc_matrix:
    """Return the tangent stiffness of all unknowns, node * 3 + axis [N/m].

    Raises:
        DivergenceError: An element is inside out.
    """
    count = solid.volumes.size
    matrix = np.empty((count, 24, 24))
    size = float(np.cbrt(solid.volumes.min()))
    if hex_stiffness(solid.points.position, solid._mesh, 1.0e-6 * size, matrix) >= 0:
        raise DivergenceError("an element is inside out: no stiffness")
    places = (3 * solid.hexes[:, :, None] + np.arange(3)).reshape(count, 24)
    rows = np.repeat(places, 24, axis=1).ravel()
    columns = np.tile(places, (1, 24)).ravel()
    whole = 3 * solid.mass.size
    return coo_matrix((matrix.ravel(), (rows, columns)), shape=(whole, whole)).tocsc()


def solid_frequencies(solid: Solid, count: int = 6) -> FloatArray:
    """Return the lowest natural frequencies [Hz] about the present state."""
    free = _free(solid)
    matrix = solid_stiffness(solid)[free][:, free]
    matrix = 0.5 * (matrix + matrix.T)
    mass = diags(np.repeat(solid.mass, 3)[free]).tocsc()
    shift = -1.0e-6 * float(abs(matrix.diagonal()).max() / mass.diagonal().max())
    values = eigsh(matrix, k=count, M=mass, sigma=shift, return_eigenvectors=False)
    return np.asarray(np.sqrt(np.maximum(np.sort(values), 0.0)) / (2.0 * math.pi))


def _free(solid: Solid) -> NDArray[np.intp]:
    return np.flatnonzero(solid._free.T.ravel() > 0.0)


def _search(solid: Solid, free: NDArray[np.intp], step: FloatArray, before: float) -> None:
    """Take the greatest halving of a step that does not raise the unbalanced force tenfold."""
    start = solid.points.position.copy()
    moved = np.zeros(start.size)
    for halving in range(12):
        moved[free] = step * 0.5**halving
        solid.points.position[:] = start + moved.reshape(-1, 3).T
        try:
            net = solid._net_forces().T.ravel()[free]
        except DivergenceError:
            continue
        if float(np.linalg.norm(net)) < 10.0 * before:
            return


RUBBER = SolidLaw(law="neo_hookean")
DIAMETER = 4.0e-3
AREA = 0.25 * math.pi * DIAMETER**2

CUBE = 0.5 * (CORNERS + 1.0)


def bar(length: float, elements: int, **options: float) -> tuple[BarMesh, Solid]:
    """Return a round bar of 4 mm and its model."""
    mesh = round_bar(DIAMETER, np.linspace(0.0, length, elements + 1))
    return mesh, Solid(mesh.nodes, mesh.hexes, RUBBER, **options)


def geometry() -> Values:
    """H03: volume, mean gradient and hourglass vectors of a distorted hexahedron."""
    corners = _distorted()
    volume, gradient, gamma = hex_geometry(corners[None])
    linear = HOURGLASS @ corners
    expected = HOURGLASS - linear @ gradient[0].T
    return {
        "volume": float(volume[0]),
        "gradient": gradient[0].tolist(),
        "gamma_dot_one": float(np.abs(gamma[0].sum(axis=1)).max()),
        "gamma_dot_x": float(np.abs(gamma[0] @ corners).max()),
        "gamma_formula": float(np.abs(gamma[0] - expected).max()),
    }


def patch() -> Values:
    """H02: a linear displacement of MacNeal and Harder's patch gives one stress everywhere."""
    law = SolidLaw(young=1.0e6, poisson=0.25)
    nodes = np.vstack([CUBE, given("H02", "inner_nodes")])
    solid = Solid(nodes, given("H02", "hexes").astype(int), law)
    # A thousandth of the published 1e-3, so that finite strain stays out of the comparison.
    scale = 1.0e-3
    field = scale * 0.5e-3 * (np.ones((3, 3)) + np.eye(3))
    moved = nodes @ field.T
    moved[8:] = 0.0
    solid.set_nodes(nodes + moved)
    solid.fix(range(8))
    solid_equilibrium(solid, increments=1, tolerance=1.0e-9)
    inner = solid.nodes[8:] - nodes[8:] - nodes[8:] @ field.T
    stress = solid.stresses() / scale
    values: Values = {"inner_error": float(np.abs(inner).max()) / scale}
    for name, (i, j) in {
        "sigma_xx": (0, 0),
        "sigma_yy": (1, 1),
        "sigma_zz": (2, 2),
        "tau_xy": (0, 1),
        "tau_yz": (1, 2),
        "tau_zx": (2, 0),
    }.items():
        component = stress[:, i, j]
        values[name] = float(component[np.argmax(np.abs(component - component.mean()))])
    return values


def rigid_rotation() -> Values:
    """H01 (solid): rotated elements carry no stress, force or energy."""
    stress, force, energy = 0.0, 0.0, 0.0
    law = SolidLaw()
    for corners in (1.0e-3 * CUBE, _distorted()):
        solid = Solid(corners, np.arange(8)[None], law)
        for turn in rotations():
            solid.set_nodes(corners @ turn.T)
            stress = max(stress, float(np.abs(solid.stresses()).max()))
            force = max(force, float(np.abs(solid.internal_forces()).max()))
            energy = max(energy, abs(solid.internal_energy()))
    return {
        "stress": stress / law.young,
        "force": force / (law.young * 1.0e-6),
        "energy": energy / (law.young * 1.0e-9),
    }


def critical_steps() -> Values:
    """H05: the step estimate against the exact critical steps of small free meshes of cubes."""
    values: Values = {}
    for counts in ((1, 1, 1), (2, 2, 2), (2, 2, 8), (4, 4, 4)):
        nodes, hexes = block(1.0e-3 * np.array(counts), counts)
        solid = Solid(nodes, hexes, SolidLaw(), bulk_viscosity=0.0, hourglass=0.0)
        values["x".join(map(str, counts))] = solid.critical_step()
    return values


def section_properties() -> Values:
    """H08: the scaled 12-gon has the circle's area and almost its second moment."""
    points, quads, rim = section_mesh(DIAMETER)
    corners = points[quads]
    x, y = corners[..., 0], corners[..., 1]
    area = 0.5 * float((x * np.roll(y, -1, 1) - np.roll(x, -1, 1) * y).sum())
    edge = points[rim]
    after = np.roll(edge, -1, axis=0)
    turn = edge[:, 0] * after[:, 1] - after[:, 0] * edge[:, 1]
    second = (
        float((turn * (edge[:, 0] ** 2 + edge[:, 0] * after[:, 0] + after[:, 0] ** 2)).sum()) / 12.0
    )
    return {"area_ratio": area / AREA, "inertia_ratio": second / (math.pi * DIAMETER**4 / 64.0)}


def uniform_bar() -> Values:
    """D01: bars under dead tension, Neo-Hookean and Mooney-Rivlin."""
    values: Values = {}
    for law in ("neo_hookean", "mooney_rivlin"):
        for stress in (0.1561, 0.3122, 0.6245, 1.249):
            mesh = round_bar(DIAMETER, np.linspace(0.0, 20.0e-3, 5))
            solid = Solid(mesh.nodes, mesh.hexes, SolidLaw(law=law))
            _guide_bottom(solid, mesh)
            _pull(solid, mesh, stress * 1.0e6 * AREA)
            solid_equilibrium(solid, increments=4)
            end = solid.nodes[mesh.sections[-1], 2].mean()
            values[f"stretch_{law}_{stress:g}"] = float(end / 20.0e-3)
    return values


def clamped_bar() -> Values:
    """D02: both ends bonded to plates; force at the reference displacement."""
    mesh, solid = bar(40.0e-3, 32)
    goal, increments = 5.354812e-3, 5
    top = mesh.sections[-1]
    solid.fix(mesh.sections[0])
    solid.fix(top)
    for k in range(increments):
        place = solid.nodes
        height = 40.0e-3 + goal * k / increments
        place[:, 2] *= 1.0 + goal / increments / height
        solid.set_nodes(place)
        solid_equilibrium(solid, increments=1)
    return {"force": -float(solid.internal_forces()[top, 2].sum())}


def cantilever() -> Values:
    """D03, H06: a rubber cantilever bent far by a tip load, and its hourglass energy."""
    mesh, solid = bar(60.0e-3, 50)
    solid.fix(mesh.sections[0])
    tip = mesh.sections[-1]
    load = 2.0 * RUBBER.young * math.pi * DIAMETER**4 / 64.0 / 0.06**2
    solid.load[0, tip] = load * _weights(solid, tip)
    solid_equilibrium(solid, increments=4)
    moved = (solid.nodes - mesh.nodes)[tip].mean(axis=0)
    return {
        "transverse": float(moved[0]),
        "axial": float(moved[2]),
        "hourglass_share": solid.hourglass_energy() / solid.internal_energy(),
    }


def modes() -> Values:
    """D06: frequencies of a clamped bar."""
    mesh, solid = bar(60.0e-3, 50)
    solid.fix(mesh.sections[0])
    f = solid_frequencies(solid, 8)
    names = {"bend1": 0, "bend2": 2, "torsion1": 4, "bend3": 5, "axial1": 7}
    return {name: float(f[number]) for name, number in names.items()}


def pure_bending() -> Values:
    """D05: end plates turned against each other without axial force: moment and elongation."""
    length, elements, curvature, turns = 24.0e-3, 24, 59.2131931, 12
    mesh, solid = bar(length, elements)
    solid.fix(mesh.sections[0])
    top = mesh.sections[-1]
    solid.fix(top)
    u = mesh.nodes[mesh.sections[0], 0]
    v = mesh.nodes[mesh.sections[0], 1]
    axial: list[float] = []
    stretches = [1.0, 1.01]
    moment = 0.0
    for attempt in range(4):
        if attempt >= 2:
            slope = (axial[-1] - axial[-2]) / (stretches[-1] - stretches[-2])
            stretches.append(stretches[-1] - axial[-1] / slope)
        for k in range(1, turns + 1) if attempt == 0 else (turns,):
            angle = curvature * mesh.axial * k / turns
            radius = stretches[attempt] / (curvature * k / turns)
            cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
            bent = np.empty_like(mesh.nodes).reshape(elements + 1, -1, 3)
            bent[..., 0] = radius * (1.0 - cosine) + u * cosine
            bent[..., 1] = v
            bent[..., 2] = (radius - u) * sine
            place = solid.nodes.reshape(bent.shape)
            if k == 1 and attempt == 0:
                place[:] = bent
            elif attempt == 0:
                # Every section turns on with its own deformation.
                before = (k - 1) / k * angle
                swing = (angle - before)[:, None]
                old = np.stack(
                    [
                        radius * k / (k - 1) * (1.0 - np.cos(before)),
                        radius * k / (k - 1) * np.sin(before),
                    ],
                    axis=1,
                )
                x, z = place[..., 0] - old[:, :1], place[..., 2] - old[:, 1:]
                place[..., 0] = radius * (1.0 - cosine) + np.cos(swing) * x + np.sin(swing) * z
                place[..., 2] = radius * sine - np.sin(swing) * x + np.cos(swing) * z
            place[-1] = bent[-1]
            solid.set_nodes(place.reshape(-1, 3))
            solid.settle(1.0e-3 if k < turns else 1.0e-4, length=500)
        force = solid.internal_forces()[top]
        direction = np.array([math.sin(curvature * length), 0.0, math.cos(curvature * length)])
        axial.append(-float((force @ direction).sum()))
        arm = solid.nodes[top] - solid.nodes[top].mean(axis=0)
        moment = abs(float(np.cross(arm, force)[:, 1].sum()))
    middle = solid.nodes[mesh.sections].mean(axis=1)
    edges = np.diff(middle, axis=0)
    long = np.linalg.norm(edges, axis=1)
    slope_angle = np.arctan2(edges[:, 0], edges[:, 2])
    third = slice(elements // 3, 2 * elements // 3)
    per = length / elements
    kappa = float(np.diff(slope_angle)[third].mean() / per)
    bending = RUBBER.young * math.pi * DIAMETER**4 / 64.0
    return {
        "moment_over_ei_kappa": moment / (bending * kappa),
        "elongation": float(long[third].mean() / per - 1.0),
        "radius": float(long[third].mean() / per / kappa),
    }


def step_load() -> Values:
    """D10: a large strain wave after a step load."""
    mesh, solid = bar(0.1, 40)
    _guide_bottom(solid, mesh)
    _pull(solid, mesh, 1.96161045)
    solid.ramp_loads([0.0, 5.0e-4], [0.0, 1.0])
    times = 5.0e-5 * np.arange(1, 241)
    track = []
    top = mesh.sections[-1]
    for _ in times:
        solid.advance(5.0e-5)
        track.append(float(solid.nodes[top, 2].mean()) - 0.1)
    return wave_record(times, track)


def _distorted() -> FloatArray:
    """Return the corners of a distorted hexahedron (8, 3) [m]."""
    return 1.0e-3 * given("H03", "nodes_mm")


def _weights(solid: Solid, section: NDArray[np.int64]) -> FloatArray:
    """Return the shares of a uniform traction on a section's nodes: as their masses."""
    return np.asarray(solid.mass[section] / solid.mass[section].sum())


def _pull(solid: Solid, mesh: BarMesh, force: float) -> None:
    top = mesh.sections[-1]
    solid.load[2, top] = force * _weights(solid, top)


def _guide_bottom(solid: Solid, mesh: BarMesh) -> None:
    """Hold the bottom along the axis; let it thin, but not move or turn in its plane."""
    bottom = mesh.sections[0]
    solid.fix(bottom, "z")
    # No node lies on an axis: hold the corners of one diagonal symmetrically.
    corner = bottom[np.argsort(mesh.nodes[bottom].sum(axis=1))[[0, -1]]]
    solid.fix(corner[:1], "xy")
    solid.fix(corner[1:], "y")
