"""Internal forces of an extensible, bending rod of isotropic round section (no twist needed).

A straight round rod bends with the energy EI phi^2 / (2 l) at every inner node, phi the turning
angle between neighbouring elements and l the mean of their reference lengths (discrete elastic
rods, Bergou et al. 2008); a circle carries exactly M = EI phi / l. Positions alone suffice:
no frames, no rotations.

Arrays: positions and forces (3, nodes); per element: reference length, tangent (3, elements),
inverse length, tension.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.compile import kernel

FloatArray = NDArray[np.float64]

# Below this value of 1 - cos(phi) (28 degrees) the series replaces acos.
_SERIES_LIMIT = 0.12


@kernel
def turning_factor(u: float) -> float:
    """Return phi / sin(phi) for u = 1 - cos(phi)."""
    if u < _SERIES_LIMIT:
        # Coefficients n! / (2n + 1)!! of the arcsine series: relative error below 1e-13.
        series = 1.0 + u * (
            0.33333333333333333
            + u
            * (
                0.13333333333333333
                + u
                * (
                    0.057142857142857143
                    + u
                    * (
                        0.025396825396825397
                        + u
                        * (
                            0.011544011544011544
                            + u
                            * (
                                0.0053280053280053280
                                + u
                                * (
                                    0.0024864024864024864
                                    + u
                                    * (
                                        0.0011700717524915897
                                        + u * (0.00055424452486443733 + u * 0.00026392596422116063)
                                    )
                                )
                            )
                        )
                    )
                )
            )
        )
        return series
    c = max(1.0 - u, -1.0 + 1.0e-12)
    return math.acos(c) / math.sqrt(1.0 - c * c)


@kernel
def turning_angle_squared(u: float) -> float:
    """Return phi^2 for u = 1 - cos(phi)."""
    if u < 1.0e-6:
        return u * (2.0 + u / 3.0)
    phi = math.acos(max(1.0 - u, -1.0))
    return phi * phi


@kernel
def law_value(stretch: float, table: FloatArray, low: float, per_spacing: float) -> float:
    """Return the tabulated nominal stress [Pa]; beyond the table its end slopes go on."""
    place = (stretch - low) * per_spacing
    last = table.shape[0] - 2
    i = int(min(max(place, 0.0), float(last)))
    u = place - i
    if u < 0.0:
        return table[0, 0] + u * table[0, 1]
    if u > 1.0:
        return table[last + 1, 0] + (u - 1.0) * table[last + 1, 1]
    a = table[i, 0]
    step = table[i + 1, 0] - a
    left = table[i, 1]
    right = table[i + 1, 1]
    return a + u * (left + u * (3.0 * step - 2.0 * left - right + u * (left + right - 2.0 * step)))


@kernel
def law_energy(stretch: float, table: FloatArray, low: float, per_spacing: float) -> float:
    """Return the tabulated energy density [J/m^3], the integral of `law_value`."""
    place = (stretch - low) * per_spacing
    last = table.shape[0] - 2
    i = int(min(max(place, 0.0), float(last)))
    u = place - i
    if u < 0.0:
        return table[0, 2] + u * (table[0, 0] + 0.5 * u * table[0, 1]) / per_spacing
    if u > 1.0:
        u -= 1.0
        end = last + 1
        return table[end, 2] + u * (table[end, 0] + 0.5 * u * table[end, 1]) / per_spacing
    a = table[i, 0]
    step = table[i + 1, 0] - a
    left = table[i, 1]
    right = table[i + 1, 1]
    second = 3.0 * step - 2.0 * left - right
    third = left + right - 2.0 * step
    return (
        table[i, 2] + u * (a + u * (left / 2.0 + u * (second / 3.0 + u * third / 4.0))) / per_spacing
    )


@kernel
def stretch_elements(
    elements: int,
    position: FloatArray,
    reference: FloatArray,
    table: FloatArray,
    low: float,
    per_spacing: float,
    area: float,
    tangent: FloatArray,
    inverse: FloatArray,
    tension: FloatArray,
) -> None:
    """Fill tangent, inverse length and tension [N] of every element."""
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
        tension[i] = area * law_value(length / reference[i], table, low, per_spacing)


@kernel
def bend_nodes(
    elements: int,
    reference: FloatArray,
    bending: float,
    tangent: FloatArray,
    cosine: FloatArray,
    slope: FloatArray,
) -> None:
    """Fill cos(phi) and dE/dcos(phi) [J] of the inner nodes 1..elements-1."""
    for i in range(1, elements):
        c = (
            tangent[0, i - 1] * tangent[0, i]
            + tangent[1, i - 1] * tangent[1, i]
            + tangent[2, i - 1] * tangent[2, i]
        )
        cosine[i] = c
        slope[i] = -2.0 * bending * turning_factor(1.0 - c) / (reference[i - 1] + reference[i])


@kernel
def bend_end(
    node: int,
    element: int,
    dx: float,
    dy: float,
    dz: float,
    reference: float,
    bending: float,
    tangent: FloatArray,
    cosine: FloatArray,
    slope: FloatArray,
) -> None:
    """Fill cos(phi) and dE/dcos(phi) of a clamped end: its direction against one element.

    The angle between the clamp and the element is half of the angle between two elements of
    the same circle, over half their length.
    """
    c = dx * tangent[0, element] + dy * tangent[1, element] + dz * tangent[2, element]
    cosine[node] = c
    slope[node] = -2.0 * bending * turning_factor(1.0 - c) / reference


@kernel
def element_force(
    elements: int,
    first: FloatArray,
    last: FloatArray,
    tangent: FloatArray,
    inverse: FloatArray,
    tension: FloatArray,
    cosine: FloatArray,
    slope: FloatArray,
    force: FloatArray,
) -> None:
    """Fill the force that each element passes on (3, elements), dE/d(edge vector) [N].

    `first` and `last` are the clamp directions (3,); their slope is zero where an end is free.
    The net force on node i is force[i] - force[i - 1].
    """
    for i in range(elements):
        tx, ty, tz = tangent[0, i], tangent[1, i], tangent[2, i]
        if i > 0:
            px, py, pz = tangent[0, i - 1], tangent[1, i - 1], tangent[2, i - 1]
        else:
            px, py, pz = first[0], first[1], first[2]
        if i < elements - 1:
            nx, ny, nz = tangent[0, i + 1], tangent[1, i + 1], tangent[2, i + 1]
        else:
            nx, ny, nz = last[0], last[1], last[2]
        a = slope[i] * inverse[i]
        b = slope[i + 1] * inverse[i]
        along = tension[i] - a * cosine[i] - b * cosine[i + 1]
        force[0, i] = along * tx + a * px + b * nx
        force[1, i] = along * ty + a * py + b * ny
        force[2, i] = along * tz + a * pz + b * nz


@kernel
def stored_energy(
    elements: int,
    position: FloatArray,
    reference: FloatArray,
    table: FloatArray,
    low: float,
    per_spacing: float,
    area: float,
) -> float:
    """Return the stretching energy [J]."""
    total = 0.0
    for i in range(elements):
        ex = position[0, i + 1] - position[0, i]
        ey = position[1, i + 1] - position[1, i]
        ez = position[2, i + 1] - position[2, i]
        stretch = math.sqrt(ex * ex + ey * ey + ez * ez) / reference[i]
        total += area * reference[i] * law_energy(stretch, table, low, per_spacing)
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
