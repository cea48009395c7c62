"""Rigid motions: where a frame stands in another one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, slots=True)
class Pose:
    """A frame in another one."""

    position: FloatArray  # Of its origin [m], shape (3,)
    rotation: FloatArray  # Its axes as columns, shape (3, 3)

    @classmethod
    def standing(cls) -> Pose:
        """Return a frame in itself."""
        return cls(position=np.zeros(3), rotation=np.eye(3))

    @classmethod
    def of(cls, position: ArrayLike, quaternion: ArrayLike) -> Pose:
        """Return a pose of a position [m] and a quaternion x, y, z, w.

        Raises:
            ValueError: A number is not finite, or the quaternion has no length.
        """
        numbers = np.concatenate([np.asarray(position, float), np.asarray(quaternion, float)])
        if not np.isfinite(numbers).all():
            raise ValueError(f"a pose must be finite, got {numbers.tolist()}")
        return cls(position=numbers[:3], rotation=Rotation.from_quat(numbers[3:]).as_matrix())

    @property
    def quaternion(self) -> FloatArray:
        """The rotation as x, y, z, w, shape (4,)."""
        return np.asarray(Rotation.from_matrix(self.rotation).as_quat())

    def __matmul__(self, other: Pose) -> Pose:
        """Return a pose in this frame as seen from where this frame is seen."""
        return Pose(position=self.point(other.position), rotation=self.rotation @ other.rotation)

    def point(self, point: ArrayLike) -> FloatArray:
        """Return a point of this frame [m] as seen from where this frame is seen, shape (3,)."""
        return np.asarray(self.position + self.rotation @ np.asarray(point, dtype=float))

    def inverse(self) -> Pose:
        """Return the other frame as seen from this one."""
        return Pose(position=-(self.rotation.T @ self.position), rotation=self.rotation.T)
