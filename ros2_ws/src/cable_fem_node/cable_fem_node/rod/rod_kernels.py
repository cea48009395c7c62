"""Internal forces of an extensible, bending rod of isotropic round section (no twist needed).

A straight round rod bends with the energy EI phi^2 / (2 l) at every inner node, phi the turning
angle between neighbouring elements and l the mean of their reference lengths (discrete elastic
rods, Bergou et al. 2008); a circle carries exactly M = EI phi / l. Positions alone suffice:
no frames, no rotations.

Arrays: positions and forces (3, nodes); per element: reference length, tangent (3, elements),
inverse length, tension.
"""

import math

import numpy as np

from cable_fem_node.dynamics.compile import called, kernel
from cable_fem_node.dynamics.state import FloatArray, Points
from cable_fem_node.rod.rod_records import AxialResponse, Constants, Work


@called
def empty_work(capacity: int) -> Work:
    """Return scratch arrays for so many nodes."""
    rows = np.zeros((14, capacity))
    return Work(
        tangent=rows[0:3],
        inverse=rows[3],
        tension=rows[4],
        cosine=rows[5],
        slope=rows[6],
        force=rows[7:10],
        net=rows[10:13],
        couple=rows[13],
    )


# Below this value of 1 - cos(phi) (28 degrees) the series replaces acos: relative error 2e-12.
SERIES_LIMIT = 0.12


@called
def turning_series(u: float) -> float:
    """Return phi / sin(phi) for small u = 1 - cos(phi): the arcsine series n! / (2n + 1)!! u^n."""
    high = 0.0024864024864024864 + u * (0.0011700717524915897 + u * 0.00055424452486443733)
    middle = 0.025396825396825397 + u * (
        0.011544011544011544 + u * (0.0053280053280053280 + u * high)
    )
    low = 0.13333333333333333 + u * (0.057142857142857143 + u * middle)
    return 1.0 + u * (0.33333333333333333 + u * low)


@called
def turning_factor(u: float) -> float:
    """Return phi / sin(phi) for u = 1 - cos(phi); beyond a right angle it stays at pi / 2.

    A hairpin between two elements is beyond the mesh; its true stiffness has no bound and no
    stable step.
    """
    if u < SERIES_LIMIT:
        return turning_series(u)
    if u >= 1.0:
        return 0.5 * math.pi
    c = 1.0 - u
    return math.acos(c) / math.sqrt(1.0 - c * c)


@kernel
def turning_angle_squared(u: float) -> float:
    """Return phi^2 for u = 1 - cos(phi), twice the integral of `turning_factor`."""
    if u < 1.0e-6:
        return u * (2.0 + u / 3.0)
    if u >= 1.0:
        return math.pi * (0.25 * math.pi + u - 1.0)
    phi = math.acos(1.0 - u)
    return phi * phi


@called
def law_value(stretch: float, response: AxialResponse) -> float:
    """Return the tabulated nominal stress [Pa]; beyond the table its end values stay.

    Of what is not a number the first: this order of max and min never leaves the table.
    """
    table = response.table
    place = min(max(0.0, (stretch - response.low) * response.per_spacing), table.shape[0] - 1.0e-9)
    i = int(place)
    u = place - i
    value: float = table[i, 0] + u * (table[i, 1] + u * (table[i, 2] + u * table[i, 3]))
    return value


@called
def law_energy(stretch: float, response: AxialResponse) -> float:
    """Return the tabulated energy density [J/m^3], the integral of `law_value`."""
    table = response.table
    place = min(max(0.0, (stretch - response.low) * response.per_spacing), table.shape[0] - 1.0e-9)
    i = int(place)
    u = place - i
    rise = table[i, 0] + u * (table[i, 1] / 2.0 + u * (table[i, 2] / 3.0 + u * table[i, 3] / 4.0))
    energy: float = table[i, 4] + u * rise / response.per_spacing
    return energy


@called
def stretch_elements(
    elements: int, position: FloatArray, reference: FloatArray, response: AxialResponse, work: Work
) -> None:
    """Fill tangent, inverse length and tension [N] of every element."""
    tangent, inverse, tension = work.tangent, work.inverse, work.tension
    for i in range(elements):
        ex = position[0, i + 1] - position[0, i]
        ey = position[1, i + 1] - position[1, i]
        ez = position[2, i + 1] - position[2, i]
        length = math.sqrt(ex * ex + ey * ey + ez * ez)
        inv = 1.0 / length
        tangent[0, i] = ex * inv
        tangent[1, i] = ey * inv
        tangent[2, i] = ez * inv
        inverse[i] = inv
        tension[i] = length / reference[i]
    for i in range(elements):
        tension[i] = response.area * law_value(tension[i], response)


@called
def bend_nodes(elements: int, reference: FloatArray, bending: float, work: Work) -> None:
    """Fill cos(phi) and dE/dcos(phi) [J] of the inner nodes 1..elements-1."""
    tangent, cosine, slope = work.tangent, work.cosine, work.slope
    # A count, unlike a maximum, lets the loop take several nodes at once.
    sharp = 0
    for i in range(1, elements):
        c = (
            tangent[0, i - 1] * tangent[0, i]
            + tangent[1, i - 1] * tangent[1, i]
            + tangent[2, i - 1] * tangent[2, i]
        )
        u = 1.0 - c
        sharp += u >= SERIES_LIMIT
        cosine[i] = c
        slope[i] = -2.0 * bending * turning_series(u) / (reference[i - 1] + reference[i])
    if sharp > 0:
        for i in range(1, elements):
            u = 1.0 - cosine[i]
            if u >= SERIES_LIMIT:
                slope[i] = -2.0 * bending * turning_factor(u) / (reference[i - 1] + reference[i])


@kernel
def bend_end(
    node: int, element: int, direction: FloatArray, reference: float, bending: float, work: Work
) -> None:
    """Fill cos(phi) and dE/dcos(phi) of a clamped end: its direction against one element.

    The angle between the clamp and the element is half of the angle between two elements of
    the same circle, over half their length.

    Args:
        node: Of the clamp.
        element: Beside it.
        direction: Unit direction of the clamp (3,).
        reference: Reference length of the element [m].
        bending: EI [N m^2].
        work: Its cosine and slope are filled.
    """
    tangent = work.tangent
    c = (
        direction[0] * tangent[0, element]
        + direction[1] * tangent[1, element]
        + direction[2] * tangent[2, element]
    )
    work.cosine[node] = c
    work.slope[node] = -2.0 * bending * turning_factor(1.0 - c) / reference


@called
def element_force(elements: int, first: FloatArray, last: FloatArray, work: Work) -> None:
    """Fill the force that each element passes on (3, elements), dE/d(edge vector) [N].

    `first` and `last` are the clamp directions (3,); their slope is zero where an end is free.
    The net force on node i is force[i] - force[i - 1].
    """
    tangent, inverse, tension = work.tangent, work.inverse, work.tension
    cosine, slope, force = work.cosine, work.slope, work.force
    end = elements - 1
    for i in range(elements):
        a = slope[i] * inverse[i]
        b = slope[i + 1] * inverse[i]
        along = tension[i] - a * cosine[i] - b * cosine[i + 1]
        for c in range(3):
            force[c, i] = along * tangent[c, i]
    for c in range(3):
        force[c, 0] += slope[0] * inverse[0] * first[c]
        force[c, end] += slope[elements] * inverse[end] * last[c]
        for i in range(1, elements):
            force[c, i] += slope[i] * inverse[i] * tangent[c, i - 1]
        for i in range(end):
            force[c, i] += slope[i + 1] * inverse[i] * tangent[c, i + 1]


@kernel
def stored_energy(
    elements: int, position: FloatArray, reference: FloatArray, response: AxialResponse
) -> float:
    """Return the stretching energy [J]."""
    total = 0.0
    for i in range(elements):
        ex = position[0, i + 1] - position[0, i]
        ey = position[1, i + 1] - position[1, i]
        ez = position[2, i + 1] - position[2, i]
        stretch = math.sqrt(ex * ex + ey * ey + ez * ez) / reference[i]
        total += response.area * reference[i] * law_energy(stretch, response)
    return total


@kernel
def bending_energy(
    elements: int, reference: FloatArray, bending: float, cosine: FloatArray
) -> float:
    """Return the bending energy [J] of the inner nodes."""
    total = 0.0
    for i in range(1, elements):
        mean = 0.5 * (reference[i - 1] + reference[i])
        total += 0.5 * bending * turning_angle_squared(1.0 - cosine[i]) / mean
    return total


@called
def roll_nodes(elements: int, dt: float, cable: Points, work: Work, k: Constants) -> None:
    """Take one step of the cable's rotation about its own axis.

    The roll angle counts from the surface normal, so a wound helix twists by its geodesic
    torsion even where the cable does not roll. Node 0 is held, the guide lets the cable spin.
    """
    roll, touching, tangent = cable.roll, cable.touching, work.tangent
    decay = 1.0 - k.damping_rate * dt
    before = 0.0
    for i in range(elements):
        after = 0.0
        if i < elements - 1:
            twist = (roll[0, i + 1] - roll[0, i]) / k.segment
            if touching[i] == 1 and touching[i + 1] == 1:
                level = math.sqrt(tangent[0, i] ** 2 + tangent[1, i] ** 2)
                twist -= tangent[2, i] * level / k.contact_line
            after = k.torsion * twist
        if i > 0:
            torque = work.couple[i] + after - before
            roll[1, i] = decay * roll[1, i] + dt * torque / k.roll_inertia
        before = after
    for i in range(1, elements):
        roll[0, i] += dt * roll[1, i]
