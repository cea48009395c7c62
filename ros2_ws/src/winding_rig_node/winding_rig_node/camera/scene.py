"""What stands before the camera at one instant: cylinder, cable, markers, guide."""

from __future__ import annotations

import colorsys
import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from winding_rig_node.camera.cable_path import WoundPath

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
        told = self.markers or (self.marker,)
        return (told + told[-1:] * count)[:count]


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

    Attributes:
        cylinder_radius: R [m].
        cable_radius: r [m].
        cylinder_angle: Theta [rad].
        path: Axial position of the wound cable; it may reach beyond Theta.
        marker_theta: Wound angle of each marker [rad], shape (m,), nan for one beyond the span.
        guide_z: Axial position of the guide [m].
        free_length: Distance of the guide before the contact line [m].
        band_width: Of a marker's ring band along the cable [m].
        dot_size: Side of the square printed on the outside of the cable that a marker is instead
            of a ring band [m]; 0 for ring bands.
        torsion: By how much the cable is twisted about itself at each marker, which turns a dot
            towards +z [rad], shape (m,) or a number.
        tail_angle: Cable clamped behind P0, opposite to the winding sense [rad].
        cylinder_ends: Axial ends of the cylinder [m].
        cylinder_speed: Turning speed [rad/s], for motion blur only.
        paint: Colours.
    """

    cylinder_radius: float
    cable_radius: float
    cylinder_angle: float
    path: WoundPath
    marker_theta: FloatArray
    guide_z: float
    free_length: float
    band_width: float = 6.0e-3
    dot_size: float = 0.0
    torsion: FloatArray | float = 0.0
    tail_angle: float = 0.5
    cylinder_ends: tuple[float, float] = (-0.018, 0.118)
    cylinder_speed: float = 0.0
    paint: Paint = field(default_factory=Paint)

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
            [
                raised * np.cos(azimuth),
                raised * np.sin(azimuth),
                self.path.height(theta),
            ],
            axis=-1,
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
