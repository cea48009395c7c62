"""First Piola-Kirchhoff stress and energy density of a deformation gradient, for every law.

linear: Biot stress 2 G (U - I) + lambda tr(U - I) I, so that nominal stress is linear in nominal
strain. hencky: Kirchhoff stress 2 G ln V + lambda tr(ln V) I; hencky_cauchy: the same as Cauchy
stress (no stored energy). neo_hookean, mooney_rivlin: see `MaterialLaw`.
"""

import math

from cable_fem_node.dynamics.compile import called, kernel
from cable_fem_node.dynamics.state import FloatArray

LINEAR, HENCKY, HENCKY_CAUCHY, HYPERELASTIC = range(4)

# The number by which `piola` selects a law of `MaterialLaw`.
KINDS = {
    "linear": LINEAR,
    "hencky": HENCKY,
    "hencky_cauchy": HENCKY_CAUCHY,
    "neo_hookean": HYPERELASTIC,
    "mooney_rivlin": HYPERELASTIC,
}


@called
def cofactor(f: FloatArray, out: FloatArray) -> float:
    """Fill the cofactor matrix of f, both of shape (3, 3); return its determinant."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i, 0] = f[j, 1] * f[k, 2] - f[j, 2] * f[k, 1]
        out[i, 1] = f[j, 2] * f[k, 0] - f[j, 0] * f[k, 2]
        out[i, 2] = f[j, 0] * f[k, 1] - f[j, 1] * f[k, 0]
    determinant: float = f[0, 0] * out[0, 0] + f[0, 1] * out[0, 1] + f[0, 2] * out[0, 2]
    return determinant


@called
def hyperelastic(
    f: FloatArray, cof: FloatArray, j: float, c10: float, c01: float, bulk: float, p: FloatArray
) -> float:
    """Fill P [Pa] of Mooney-Rivlin (Neo-Hookean with C01 = 0); return the energy density [J/m^3].

    f, its cofactor and p have the shape (3, 3), j = det f; c10, c01 and bulk in [Pa].
    """
    i1 = 0.0
    for a in range(3):
        for b in range(3):
            i1 += f[a, b] * f[a, b]
    per = 1.0 / j
    third = math.exp(-2.0 / 3.0 * math.log(j))
    a1 = 2.0 * c10 * third
    lead = a1
    along = bulk * (j - 1.0) - a1 * i1 / 3.0 * per
    energy = c10 * (third * i1 - 3.0) + 0.5 * bulk * (j - 1.0) ** 2
    if c01 == 0.0:
        for a in range(3):
            for b in range(3):
                p[a, b] = lead * f[a, b] + along * cof[a, b]
        return energy
    square = 0.0
    for a in range(3):
        for b in range(3):
            c = f[0, a] * f[0, b] + f[1, a] * f[1, b] + f[2, a] * f[2, b]
            square += c * c
    i2 = 0.5 * (i1 * i1 - square)
    a2 = 2.0 * c01 * third * third
    along -= 2.0 / 3.0 * a2 * i2 * per
    lead += a2 * i1
    for a in range(3):
        for b in range(3):
            fc = 0.0
            for k in range(3):
                c = f[0, k] * f[0, b] + f[1, k] * f[1, b] + f[2, k] * f[2, b]
                fc += f[a, k] * c
            p[a, b] = lead * f[a, b] - a2 * fc + along * cof[a, b]
    return energy + c01 * (third * third * i2 - 3.0)


@kernel
def biot(
    f: FloatArray, j: float, shear: float, lame: float, c: FloatArray, u: FloatArray, p: FloatArray
) -> float:
    """Fill P [Pa] of the linear law on Biot strain; return the energy density [J/m^3].

    f, p and the scratch c, u have the shape (3, 3), j = det f; shear and lame in [Pa].

    The polar rotation comes from the invariants of U = sqrt(F^T F) (Hoger and Carlson 1984).
    """
    i1 = 0.0
    square = 0.0
    for a in range(3):
        for b in range(3):
            c[a, b] = f[0, a] * f[0, b] + f[1, a] * f[1, b] + f[2, a] * f[2, b]
            square += c[a, b] * c[a, b]
        i1 += c[a, a]
    i2 = 0.5 * (i1 * i1 - square)
    trace = math.sqrt(3.0 * i1)
    # Newton from above on tr U: (t^2 - I)^2 / 4 - II - 2 J t has its largest root there.
    for _ in range(30):
        gap = trace * trace - i1
        value = 0.25 * gap * gap - i2 - 2.0 * j * trace
        change = value / (trace * gap - 2.0 * j)
        trace -= change
        if abs(change) < 1.0e-14 * trace:
            break
    second = 0.5 * (trace * trace - i1)
    scale = 1.0 / (trace * second - j)
    for a in range(3):
        for b in range(3):
            cc = c[a, 0] * c[0, b] + c[a, 1] * c[1, b] + c[a, 2] * c[2, b]
            u[a, b] = scale * ((trace * trace - second) * c[a, b] - cc)
        u[a, a] += scale * trace * j
    pressure = lame * (trace - 3.0) - 2.0 * shear
    per = pressure / j
    for a in range(3):
        for b in range(3):
            c[a, b] = per * (c[a, b] - trace * u[a, b])
        c[a, a] += per * second + 2.0 * shear
    for a in range(3):
        for b in range(3):
            p[a, b] = f[a, 0] * c[0, b] + f[a, 1] * c[1, b] + f[a, 2] * c[2, b]
    strain = i1 - 2.0 * trace + 3.0
    return shear * strain + 0.5 * lame * (trace - 3.0) ** 2


@called
def logarithmic(
    f: FloatArray,
    j: float,
    shear: float,
    lame: float,
    cauchy: bool,
    c: FloatArray,
    vectors: FloatArray,
    p: FloatArray,
) -> float:
    """Fill P [Pa] of a Hencky law by Jacobi's eigenvalues of F^T F; return the energy [J/m^3].

    f, p and the scratch c, vectors have the shape (3, 3), j = det f; shear and lame in [Pa].
    """
    for a in range(3):
        for b in range(3):
            c[a, b] = f[0, a] * f[0, b] + f[1, a] * f[1, b] + f[2, a] * f[2, b]
            vectors[a, b] = 1.0 if a == b else 0.0
    for _ in range(12):
        off = c[0, 1] ** 2 + c[0, 2] ** 2 + c[1, 2] ** 2
        if off < 1.0e-30 * (c[0, 0] + c[1, 1] + c[2, 2]) ** 2:
            break
        for a in range(2):
            for b in range(a + 1, 3):
                if c[a, b] != 0.0:
                    ratio = 0.5 * (c[b, b] - c[a, a]) / c[a, b]
                    sign = 1.0 if ratio >= 0.0 else -1.0
                    t = sign / (abs(ratio) + math.sqrt(1.0 + ratio * ratio))
                    co = 1.0 / math.sqrt(1.0 + t * t)
                    si = t * co
                    for k in range(3):
                        left, right = c[k, a], c[k, b]
                        c[k, a], c[k, b] = co * left - si * right, si * left + co * right
                    for k in range(3):
                        left, right = c[a, k], c[b, k]
                        c[a, k], c[b, k] = co * left - si * right, si * left + co * right
                    for k in range(3):
                        left, right = vectors[k, a], vectors[k, b]
                        vectors[k, a] = co * left - si * right
                        vectors[k, b] = si * left + co * right
    log0, log1, log2 = 0.5 * math.log(c[0, 0]), 0.5 * math.log(c[1, 1]), 0.5 * math.log(c[2, 2])
    volume = log0 + log1 + log2
    factor = j if cauchy else 1.0
    s0 = factor * (2.0 * shear * log0 + lame * volume) / c[0, 0]
    s1 = factor * (2.0 * shear * log1 + lame * volume) / c[1, 1]
    s2 = factor * (2.0 * shear * log2 + lame * volume) / c[2, 2]
    for a in range(3):
        for b in range(3):
            c[a, b] = (
                s0 * vectors[a, 0] * vectors[b, 0]
                + s1 * vectors[a, 1] * vectors[b, 1]
                + s2 * vectors[a, 2] * vectors[b, 2]
            )
    for a in range(3):
        for b in range(3):
            p[a, b] = f[a, 0] * c[0, b] + f[a, 1] * c[1, b] + f[a, 2] * c[2, b]
    return shear * (log0 * log0 + log1 * log1 + log2 * log2) + 0.5 * lame * volume * volume


@kernel
def piola(
    law: int,
    f: FloatArray,
    constants: FloatArray,
    cof: FloatArray,
    one: FloatArray,
    two: FloatArray,
    p: FloatArray,
) -> tuple[float, float]:
    """Fill P [Pa] of the deformation gradient f; return (J, energy density [J/m^3]).

    `constants`: G, lambda, K, then the law's own coefficients [Pa]. A J that is not positive leaves
    P as it is.
    """
    j = cofactor(f, cof)
    if not j > 0.0:
        return j, 0.0
    if law == HYPERELASTIC:
        energy = hyperelastic(f, cof, j, constants[3], constants[4], constants[2], p)
    elif law == LINEAR:
        energy = biot(f, j, constants[0], constants[1], one, two, p)
    else:
        energy = logarithmic(f, j, constants[0], constants[1], law == HENCKY_CAUCHY, one, two, p)
    return j, energy
