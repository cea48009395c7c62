"""What disturbs the picture: photographs behind, decoys beside, rods before the cable."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from winding_rig_node.camera.config import CameraConfig
from winding_rig_node.camera.scene import Colour

SingleArray = NDArray[np.float32]
ByteArray = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class Patch:
    """A flat rectangle fixed before the camera.

    Attributes:
        column: Of its middle on the full sensor [px].
        row: Of its middle on the full sensor [px].
        width: [px]
        height: [px]
        colour: Radiance, blue-green-red.
        in_front: Whether it hides cylinder and cable, like a rod; otherwise it stands behind.
    """

    column: float
    row: float
    width: float
    height: float
    colour: Colour
    in_front: bool = False

    def __post_init__(self) -> None:
        if not (self.width > 0.0 and self.height > 0.0):
            raise ValueError(f"patch size must be positive, got {self.width} x {self.height} px")


@dataclass(frozen=True, kw_only=True, eq=False)
class Surroundings:
    """Everything that stands still around the cylinder.

    Attributes:
        patches: Decoys and rods.
        photograph: Fills the backdrop, blue-green-red, uint8 of shape (any, any, 3); None for a
            plain one.
    """

    patches: tuple[Patch, ...] = ()
    photograph: ByteArray | None = None

    def __post_init__(self) -> None:
        photo = self.photograph
        if photo is not None and (
            photo.dtype != np.uint8 or photo.ndim != 3 or photo.shape[2] != 3 or photo.size == 0
        ):
            raise ValueError(
                f"photograph must be uint8 of shape (h, w, 3), got {photo.dtype} {photo.shape}"
            )

    def behind(self, config: CameraConfig, radiance: SingleArray) -> SingleArray:
        """Return the backdrop with photograph and decoys, shape (rows, columns, 3).

        Args:
            config: The camera.
            radiance: Plain backdrop of the same shape.
        """
        out = radiance.copy()
        if self.photograph is not None:
            window = config.window
            whole = cv2.resize(
                self.photograph, (config.width, config.height), interpolation=cv2.INTER_AREA
            )
            part = whole[
                window.y_offset : window.y_offset + window.height,
                window.x_offset : window.x_offset + window.width,
            ]
            rows, columns = window.shape
            out[:] = cv2.resize(part, (columns, rows), interpolation=cv2.INTER_AREA)
        for patch in self.patches:
            if not patch.in_front:
                _blend(out, coverage(config, patch), patch.colour)
        return out

    def cover(self, config: CameraConfig, radiance: SingleArray) -> SingleArray:
        """Return a picture with everything that stands before the cable painted over it."""
        front = [patch for patch in self.patches if patch.in_front]
        if not front:
            return radiance
        out = radiance.copy()
        for patch in front:
            _blend(out, coverage(config, patch), patch.colour)
        return out


def coverage(config: CameraConfig, patch: Patch) -> SingleArray:
    """Return which share of each pixel a patch covers, shape (rows, columns)."""
    window = config.window
    rows, columns = window.shape
    across = _overlap(patch.column - window.x_offset, patch.width, columns, window.binning)
    down = _overlap(patch.row - window.y_offset, patch.height, rows, window.binning)
    return (down[:, None] * across[None, :]).astype(np.float32)


def _overlap(middle: float, size: float, count: int, binning: int) -> NDArray[np.float64]:
    edges = np.arange(count + 1) * binning - 0.5
    first, last = middle - 0.5 * size, middle + 0.5 * size
    shared = np.minimum(edges[1:], last) - np.maximum(edges[:-1], first)
    return np.asarray(np.clip(shared / binning, 0.0, 1.0), dtype=float)


def _blend(picture: SingleArray, share: SingleArray, colour: Colour) -> None:
    picture += share[..., None] * (np.array(colour, dtype=np.float32) - picture)
