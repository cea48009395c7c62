"""What stands before the camera: cylinder, cable, markers, guide, and what disturbs the picture."""

import colorsys
import math
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from winding_rig_node.camera.cable_path import WoundPath
from winding_rig_node.camera.config import CameraConfig

SingleArray = NDArray[np.float32]
ByteArray = NDArray[np.uint8]

FloatArray = NDArray[np.float64]
Colour = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Paint:
    """Colours of marker, cable, cylinder and backdrop, blue-green-red.

    Reflectance of 0 to 255 under nominal light. `markers` are those of P0, P1 and so on where they
    differ; the last one holds for all further markers.
    """

    marker: Colour = (25.0, 185.0, 225.0)
    cable: Colour = (150.0, 150.0, 156.0)
    cylinder: Colour = (96.0, 92.0, 90.0)
    backdrop: Colour = (46.0, 42.0, 40.0)
    markers: tuple[Colour, ...] = ()

    def of_markers(self, count: int) -> tuple[Colour, ...]:
        """Return the colour of each of a number of markers."""
        given = self.markers or (self.marker,)
        return (given + given[-1:] * count)[:count]


def paint_of_hue(hue: float) -> Colour:
    """Return a paint of a hue [deg] as bright and as strong as the markers' own yellow."""
    red, green, blue = colorsys.hsv_to_rgb(hue / 360.0, 0.89, 225.0)
    return blue, green, red


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A snapshot in the lab frame: the cylinder turns about +z and the cable lands at azimuth 0.

    A point wound theta behind P0 stands at azimuth cylinder_angle - theta. Cable that is not
    wound yet lies on the straight span from the landing point towards -y, at the distance
    (R + r) (theta - cylinder_angle) before the contact line.
    """

    cylinder_radius: float  # R [m]
    cable_radius: float  # r [m]
    cylinder_angle: float  # Theta [rad]
    path: WoundPath  # Axial position of the wound cable; it may reach beyond Theta
    # Wound angle of each marker [rad], shape (m,), nan for one beyond the span.
    marker_theta: FloatArray
    guide_z: float  # Axial position of the guide [m]
    free_length: float  # Distance of the guide before the contact line [m]
    band_width: float = 6.0e-3  # Of a marker's ring band along the cable [m]
    # Side of the square printed on the outside of the cable that a marker is instead of a ring band
    # [m]; 0 for ring bands.
    dot_size: float = 0.0
    # By how much the cable is twisted about itself at each marker, which turns a dot towards +z
    # [rad], shape (m,) or a number.
    torsion: FloatArray | float = 0.0
    tail_angle: float = 0.5  # Cable clamped behind P0, opposite to the winding sense [rad]
    cylinder_ends: tuple[float, float] = (-0.018, 0.118)  # Axial ends of the cylinder [m]
    flange_height: float = 0.0  # Of flanges beyond these ends over the cylinder [m]; 0 for none
    cylinder_speed: float = 0.0  # Turning speed [rad/s], for motion blur only
    paint: Paint = field(default_factory=Paint)  # Colours

    def __post_init__(self) -> None:
        for name in ("cylinder_radius", "cable_radius", "free_length", "band_width"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be positive, got {value} m")
        for name in ("cylinder_angle", "guide_z", "cylinder_speed"):
            value = getattr(self, name)
            if not math.isfinite(value):
                raise ValueError(f"{name} must be finite, got {value}")

    @property
    def centreline_radius(self) -> float:
        """R + r [m]."""
        return self.cylinder_radius + self.cable_radius

    @property
    def landing_z(self) -> float:
        """Axial position of the contact line's landing point [m]."""
        return float(self.path.height(np.array(self.cylinder_angle)))

    @property
    def landing_lift(self) -> float:
        """How high the cable lands on other turns [m]."""
        return float(self.path.lifted(np.array(self.cylinder_angle)))

    def centreline(self, theta: NDArray[np.float64]) -> FloatArray:
        """Return lab points of the cable's centre line at wound angles, shape (n, 3)."""
        theta = np.asarray(theta, dtype=float)
        rho = self.centreline_radius
        raised = rho + self.path.lifted(theta)
        azimuth = self.cylinder_angle - theta
        way = rho * (theta - self.cylinder_angle)
        landing = self.landing_z
        wound = np.stack(
            [raised * np.cos(azimuth), raised * np.sin(azimuth), self.path.height(theta)], axis=-1
        )
        free = np.stack(
            [
                np.full_like(way, rho + self.landing_lift),
                -way,
                landing + (self.guide_z - landing) * way / self.free_length,
            ],
            axis=-1,
        )
        return np.where((way > 0.0)[:, None], free, wound)


@dataclass(frozen=True, kw_only=True)
class Patch:
    """A flat rectangle fixed before the camera."""

    column: float  # Of its middle on the full sensor [px]
    row: float  # Of its middle on the full sensor [px]
    width: float  # [px]
    height: float  # [px]
    colour: Colour  # Radiance, blue-green-red
    # Whether it hides cylinder and cable, like a rod; otherwise it stands behind.
    in_front: bool = False

    def __post_init__(self) -> None:
        if not (self.width > 0.0 and self.height > 0.0):
            raise ValueError(f"patch size must be positive, got {self.width} x {self.height} px")


@dataclass(frozen=True, kw_only=True, eq=False)
class Surroundings:
    """Everything that stands still around the cylinder."""

    patches: tuple[Patch, ...] = ()  # Decoys and rods
    # Fills the backdrop, blue-green-red, uint8 of shape (any, any, 3); None for a plain one.
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
