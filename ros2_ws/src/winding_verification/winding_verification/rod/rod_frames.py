"""Material frames of a rod at the start: parallel along it, so that they carry no twist."""

from __future__ import annotations

import numpy as np

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.rod.rod_kernels import empty_work
from winding_verification.rod.rod_step_kernels import RodScratch


def perpendicular(tangent: FloatArray, hint: FloatArray) -> FloatArray:
    """Return the unit vector across a unit tangent that lies closest to a hint, all (3,)."""
    part = hint - (hint @ tangent) * tangent
    return np.asarray(part / np.linalg.norm(part))


def frames_along(walled: FloatArray) -> RodScratch:
    """Return frames without a twist of their own, and scratch, for tangents (3, elements + 2)."""
    count = walled.shape[1] - 2
    director = np.zeros((3, count + 2))
    axis = np.eye(3)[int(np.argmin(np.abs(walled[:, 0])))]
    director[:, 0] = perpendicular(walled[:, 0], axis)
    for i in range(1, count + 2):
        a, b, v = walled[:, i - 1], walled[:, i], director[:, i - 1]
        turn = np.cross(a, b)
        moved = v * (a @ b) + np.cross(turn, v) + turn * (turn @ v) / (1.0 + a @ b)
        director[:, i] = perpendicular(b, moved)
    return RodScratch(
        director=director,
        carried=walled.copy(),
        angle=np.zeros(count + 2),
        spin=np.zeros(count + 2),
        own_twist=np.zeros(count + 1),
        curvature=np.zeros((3, count + 1)),
        work=empty_work(count + 1),
        walled=walled.copy(),
        walled_inverse=np.zeros(count + 2),
        walled_force=np.zeros((3, count + 2)),
        torque=np.zeros(count + 2),
    )
