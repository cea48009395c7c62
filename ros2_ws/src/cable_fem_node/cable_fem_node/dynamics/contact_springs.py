"""How deep nodes lie in what they touch: forces, energies and the longest step of the springs."""

import math

import numpy as np

from cable_fem_node.dynamics.compile import called, kernel
from cable_fem_node.dynamics.state import (
    BELOW_ROWS,
    GONE,
    MOST_BELOW,
    ContactLaw,
    FloatArray,
    Points,
)

# Within so many distances of centre lines cable may come to be touched before the next look.
NEAR = 0.15


def normal_forces(points: Points, touch: ContactLaw) -> FloatArray:
    """Return with which force [N] the penalty springs of every node push, shape (nodes,)."""
    deep = depths(points, touch, points.touching.size)
    return np.asarray(
        touch.normal_stiffness * deep[0] + touch.beside_stiffness * deep[1:].sum(axis=0)
    )


def contact_energy(points: Points, touch: ContactLaw) -> float:
    """Return the energy [J] in the normal and stick springs of all nodes."""
    deep = (depths(points, touch, points.touching.size) ** 2).sum(axis=1)
    slip = points.slip[:, points.touching == 1]
    return 0.5 * (
        touch.normal_stiffness * float(deep[0])
        + touch.beside_stiffness * float(deep[1:].sum())
        + touch.stick_stiffness * float((slip**2).sum())
    )


@kernel
def lying_energy(points: Points, touch: ContactLaw, nodes: int) -> float:
    """Return the energy [J] in the springs between the first nodes and the cable below."""
    deep, total = depths(points, touch, nodes), 0.0
    for n in range(1, len(deep) - 1):
        for i in range(nodes):
            total += deep[n, i] * deep[n, i]
    return 0.5 * touch.beside_stiffness * total


@kernel
def depths(points: Points, touch: ContactLaw, nodes: int) -> FloatArray:  # pragma: no cover
    """Return how deep nodes lie [m] in the cylinder, in cable below and in a flange, (k, nodes)."""
    z, below = points.position[2], points.below
    radius = np.hypot(points.position[0, :nodes], points.position[1, :nodes])
    deep = np.zeros((2 + MOST_BELOW * int(below.size > 0), nodes))
    for i in range(nodes):
        if points.touching[i] == 1:
            deep[0, i] = max(points.contact_radius[i] - radius[i], 0.0)
        if radius[i] < touch.rim:
            deep[-1, i] = max(touch.low - z[i], z[i] - touch.high, 0.0)
        for n in range(len(deep) - 2):
            least = below[BELOW_ROWS * n + 4, i]
            if least == 0.0:
                break
            up, aside, along = _across(points, touch, radius, BELOW_ROWS * n, i)
            apart = math.sqrt(max(up * up + aside * aside - along, 0.0))
            deep[1 + n, i] = max(least - apart, 0.0)
    return deep


@called
def _across(
    points: Points, touch: ContactLaw, radius: FloatArray, first: int, i: int
) -> tuple[float, float, float]:
    """Return how far node i lies up and aside of cable below [m], and the square along that."""
    z, below = points.position[2], points.below
    at, there = below[first, i], below[first + 1, i]
    rise, slope = below[first + 2, i], below[first + 3, i]
    gone, per_square = below[GONE, i], below[first + 8, i]
    j, share = int(below[first + 5, i]), below[first + 6, i]
    if j >= 0:
        at = (1.0 - share) * _line(radius[j], touch) + share * _line(radius[j + 1], touch)
        there = (1.0 - share) * z[j] + share * z[j + 1]
        gone -= (1.0 - share) * below[GONE, j] + share * below[GONE, j + 1]
    above = 2.0 * points.contact_radius[i] - touch.chords - touch.line
    up = radius[i] - above * touch.line / max(radius[i], touch.line) - at - rise * gone
    aside = z[i] - there - slope * gone
    return up, aside, (up * rise + aside * slope) ** 2 * per_square


@called
def _line(radius: float, touch: ContactLaw) -> float:
    """Return the radius of the centre line at a node, which chords join [m]."""
    return radius - (touch.chords - touch.line) * touch.line / max(radius, touch.line)


@kernel
def stiffest(points: Points, touch: ContactLaw, nodes: int) -> float:
    """Return a stiffness [N/m] that contact has in no motion of the first nodes across the cable.

    Of all that they may touch until they leave their room: of each node the greatest eigenvalue of
    its own block and the norms of those beside it (Gershgorin's theorem for blocks, Feingold and
    Varga 1962). Friction has it in any direction.
    """
    z, below, beside = points.position[2], points.below, touch.beside_stiffness
    radius = np.hypot(points.position[0, :nodes], points.position[1, :nodes])
    near = NEAR * touch.apart
    # Rows of each node's block, radius, both and z, and what does not depend on a direction.
    block = np.zeros((4, nodes))
    for i in range(nodes):
        if radius[i] < points.contact_radius[i] + near:
            block[0, i] += touch.normal_stiffness
            block[3, i] = touch.stick_stiffness
        if radius[i] < touch.rim and not touch.low + near < z[i] < touch.high - near:
            block[2, i] += beside
        rubbed = False
        for first in range(0, GONE, BELOW_ROWS):
            if below[first + 4, i] == 0.0:
                break
            up, aside, _ = _across(points, touch, radius, first, i)
            far = math.sqrt(up * up + aside * aside)
            if far > below[first + 4, i] + near:
                continue
            up, aside = up / far, aside / far
            block[3, i] = max(block[3, i], touch.stick_stiffness)
            _stiffen(block, i, beside, up, aside)
            j, share = int(below[first + 5, i]), below[first + 6, i]
            if j < 0:
                continue
            # A node's friction acts back once, a push each time.
            rubs = 0.0 if rubbed else touch.stick_stiffness
            rubbed = True
            block[3, i] += beside + rubs
            for e, part in ((j, 1.0 - share), (j + 1, share)):
                _stiffen(block, e, part * part * beside, up, aside)
                block[3, e] += part * ((2.0 - part) * beside + 2.0 * rubs)
    most = 0.0
    for i in range(nodes):
        half = 0.5 * (block[0, i] - block[2, i])
        greatest = block[0, i] - half + math.sqrt(half * half + block[1, i] * block[1, i])
        most = max(most, greatest + block[3, i])
    return most


@called
def _stiffen(block: FloatArray, i: int, stiffness: float, up: float, aside: float) -> None:
    block[0, i] += stiffness * up * up
    block[1, i] += stiffness * up * aside
    block[2, i] += stiffness * aside * aside


@called
def _fastest(points: Points, nodes: int, rate: float) -> float:
    """Return the greatest speed [m/s] across their way of nodes that outrun a surface [rad/s]."""
    x, v = points.position, points.velocity
    most = 0.0
    for i in range(nodes):
        if points.below[4, i] > 0.0:
            square = x[0, i] * x[0, i] + x[1, i] * x[1, i]
            rising = v[0, i] * x[0, i] + v[1, i] * x[1, i]
            across = rising * rising / square + v[2, i] * v[2, i]
            if across > rate * rate * square:
                most = max(most, across)
    return math.sqrt(most)


@kernel
def springs(
    points: Points, touch: ContactLaw, nodes: int, rate: float
) -> tuple[float, float, float]:
    """Return `lying_energy`, `stiffest` and the speed of what falls off cable, 0 for none [m/s]."""
    lying = lying_energy(points, touch, nodes)
    return lying, stiffest(points, touch, nodes), _fastest(points, nodes, rate)


def stable_step(mass: float, others: float, contact: float, touch: ContactLaw) -> float:
    """Return the longest stable step [s] of a node of a mass [kg].

    Its dampers c act by the velocity half a step before, so that it is k dt^2 + 2 c dt = 4 m.

    Args:
        mass: Of the node [kg].
        others: Stiffness of what is not damped [N/m].
        contact: Stiffness of contact [N/m].
        touch: Whose dampers cable on cable has.
    """
    damping = contact * touch.beside_damping / touch.beside_stiffness
    whole = others + contact
    return (math.sqrt(damping * damping + 4.0 * whole * mass) - damping) / whole
