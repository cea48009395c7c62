"""Reference geometry of one-point hexahedra: volume, mean gradient, hourglass vectors.

Node order as usual: 0-3 around the bottom, 4-7 above them. The gradient is averaged over the
volume (Flanagan and Belytschko 1981), which makes the patch test exact on distorted elements;
the hourglass vectors gamma = h - (h . x_i) b_i see no linear motion.
"""

import numpy as np
from numpy.typing import ArrayLike

from cable_fem_node.dynamics.state import FloatArray

CORNERS = np.array(
    [
        [-1, -1, -1],
        [1, -1, -1],
        [1, 1, -1],
        [-1, 1, -1],
        [-1, -1, 1],
        [1, -1, 1],
        [1, 1, 1],
        [-1, 1, 1],
    ],
    dtype=float,
)

# The four patterns of +-1 that a one-point element does not resist: eta zeta, zeta xi, xi eta,
# xi eta zeta.
HOURGLASS = np.stack(
    [
        CORNERS[:, 1] * CORNERS[:, 2],
        CORNERS[:, 2] * CORNERS[:, 0],
        CORNERS[:, 0] * CORNERS[:, 1],
        CORNERS[:, 0] * CORNERS[:, 1] * CORNERS[:, 2],
    ]
)


def hex_geometry(corners: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (volumes (m,), mean gradients (m, 8, 3), hourglass vectors (m, 4, 8)).

    Args:
        corners: Node positions of the elements (m, 8, 3) [m].

    Raises:
        ValueError: An element is inside out or flat.
    """
    x = np.asarray(corners, dtype=float)
    if x.ndim != 3 or x.shape[1:] != (8, 3):
        raise ValueError(f"hexahedra have corners of shape (m, 8, 3), got {x.shape}")
    volume = np.zeros(x.shape[0])
    gradient = np.zeros_like(x)
    # det(J) dN/dx is quadratic in each coordinate: two Gauss points per direction are exact.
    points, weights = np.polynomial.legendre.leggauss(2)
    for a, wa in zip(points, weights, strict=True):
        for b, wb in zip(points, weights, strict=True):
            for c, wc in zip(points, weights, strict=True):
                slopes = _slopes(np.array([a, b, c]))
                jacobian = np.einsum("ak,mai->mik", slopes, x)
                determinant = np.linalg.det(jacobian)
                if not np.all(determinant > 0.0):
                    worst = int(np.argmin(determinant))
                    raise ValueError(f"element {worst} is inside out: its Jacobian is not positive")
                weight = wa * wb * wc * determinant
                inverse = np.linalg.inv(jacobian)
                volume += weight
                gradient += weight[:, None, None] * np.einsum("ak,mki->mai", slopes, inverse)
    gradient /= volume[:, None, None]
    linear = np.einsum("ha,mai->mhi", HOURGLASS, x)
    gamma = HOURGLASS[None] - np.einsum("mhi,mai->mha", linear, gradient)
    return volume, gradient, gamma


def greatest_stiffness(
    volume: FloatArray, gradient: FloatArray, shear: float, lame: float
) -> FloatArray:
    """Return the greatest eigenvalue [N/m] of each element's stiffness, shape (m,).

    K = V B^T D B has the non-zero eigenvalues of the 6 x 6 matrix V L^T (B B^T) L, D = L L^T.
    """
    count = volume.size
    strain = np.zeros((count, 6, 8, 3))
    for i in range(3):
        strain[:, i, :, i] = gradient[:, :, i]
    for row, (i, j) in enumerate(((0, 1), (1, 2), (2, 0)), start=3):
        strain[:, row, :, i] = gradient[:, :, j]
        strain[:, row, :, j] = gradient[:, :, i]
    flat = strain.reshape(count, 6, 24)
    elastic = np.zeros((6, 6))
    elastic[:3, :3] = lame
    elastic[range(3), range(3)] += 2.0 * shear
    elastic[range(3, 6), range(3, 6)] = shear
    root = np.linalg.cholesky(elastic)
    small = root.T @ (flat @ np.swapaxes(flat, 1, 2)) @ root
    return np.asarray(volume * np.linalg.eigvalsh(small)[:, -1])


def _slopes(at: FloatArray) -> FloatArray:
    shape = 1.0 + CORNERS * at
    slopes = np.empty((8, 3))
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        slopes[:, k] = 0.125 * CORNERS[:, k] * shape[:, i] * shape[:, j]
    return slopes
