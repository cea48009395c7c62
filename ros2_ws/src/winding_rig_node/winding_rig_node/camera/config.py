"""What the simulated camera is: sensor, lens, pose, window, noise."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

PLUMB_BOB = "plumb_bob"
BGR8 = "bgr8"
# Columns: camera x, y, z in the lab frame. The camera looks along -x with image x along +z.
NOMINAL_AXES = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


@dataclass(frozen=True, kw_only=True)
class Window:
    """Region of interest on the sensor, in full-resolution pixels, and its binning (REP-104).

    A binned pixel is the mean of binning x binning sensor pixels, so the centre of column i lies
    at the full-resolution column x_offset + binning (i + 1/2) - 1/2.
    """

    x_offset: int = 0  # First column
    y_offset: int = 393  # First row
    width: int = 1920  # Columns, before binning
    height: int = 288  # Rows, before binning
    binning: int = 3  # Sensor pixels on a side of one pixel of the frame

    def __post_init__(self) -> None:
        if self.binning < 1:
            raise ValueError(f"binning must be at least 1, got {self.binning}")
        if min(self.x_offset, self.y_offset) < 0:
            raise ValueError(
                f"window offsets must not be negative, got ({self.x_offset}, {self.y_offset})"
            )
        for name in ("width", "height"):
            value = getattr(self, name)
            if value < self.binning or value % self.binning:
                raise ValueError(
                    f"window {name} must be a positive multiple of the binning {self.binning}, "
                    f"got {value}"
                )

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the image that the camera delivers."""
        return self.height // self.binning, self.width // self.binning


@dataclass(frozen=True, kw_only=True)
class SensorNoise:
    """Noise of the sensor in grey levels of eight bits."""

    read: float = 1.5  # Standard deviation of a dark pixel
    shot: float = 0.03  # Variance added per grey level of signal

    def __post_init__(self) -> None:
        for name in ("read", "shot"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} noise must not be negative, got {value}")


@dataclass(frozen=True, kw_only=True)
class Light:
    """How the scene is lit."""

    gain: float = 1.0  # Exposure factor, 1 for the nominal light
    # From the scene towards the lamp, in the lab frame; need not be a unit vector.
    direction: tuple[float, float, float] = (1.0, -0.25, 0.1)
    ambient: float = 0.35  # Share of the light without a direction
    highlight: float = 0.08  # Strength of the specular highlight on the cable, share of white
    gloss: float = 24.0  # Exponent of the highlight
    falloff: float = 0.12  # Relative loss of light from the middle of the window to its corners
    # Each frame's light is multiplied by a factor drawn between 1 / (1 + flicker) and 1 + flicker.
    flicker: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.gain) and self.gain > 0.0):
            raise ValueError(f"gain must be positive, got {self.gain}")
        if not np.linalg.norm(self.direction) > 0.0:
            raise ValueError(f"direction must not be zero, got {self.direction}")
        if not (math.isfinite(self.flicker) and self.flicker >= 0.0):
            raise ValueError(f"flicker must not be negative, got {self.flicker}")
        for name in ("ambient", "highlight", "falloff"):
            value = getattr(self, name)
            if not 0.0 <= value <= 1.0:
                raise ValueError(f"{name} must lie in [0, 1], got {value}")


@dataclass(frozen=True, kw_only=True)
class CameraCalibration:
    """Content of a sensor_msgs/CameraInfo, in full-resolution pixels."""

    width: int  # Columns of the full sensor
    height: int  # Rows of the full sensor
    distortion_model: str  # "plumb_bob"
    d: NDArray[np.float64]  # Distortion k1, k2, p1, p2, k3, shape (5,)
    k: NDArray[np.float64]  # Camera matrix, shape (3, 3)
    roi: tuple[int, int, int, int]  # x_offset, y_offset, width, height
    binning: int  # binning_x = binning_y


@dataclass(frozen=True, kw_only=True)
class CameraConfig:
    """A camera at +x of the cylinder that looks along -x: image x is +z, image y is +y."""

    width: int = 1920  # Columns of the full sensor
    height: int = 1080  # Rows of the full sensor
    focal: float = 4900.0  # Focal length [px]; with the default pose 12.5 px/mm at the cylinder
    centre: tuple[float, float] = (963.2, 536.6)  # Principal point, column and row [px]
    # Brown-Conrady k1, k2, p1, p2, k3.
    distortion: tuple[float, float, float, float, float] = (-0.12, 0.05, 4.0e-4, -3.0e-4, 0.0)
    # Of the camera's centre in the lab frame [m].
    position: tuple[float, float, float] = (0.4175, 0.0, 0.05)
    # Rotation vector about the camera's own axes that turns it away from the nominal orientation
    # [rad].
    tilt: tuple[float, float, float] = (0.0, 0.0, 0.0)
    window: Window = field(default_factory=Window)  # Region and binning that it delivers
    noise: SensorNoise = field(default_factory=SensorNoise)  # Of the sensor
    light: Light = field(default_factory=Light)  # On the scene
    supersampling: int = 2  # Samples per pixel and direction
    encoding: str = BGR8  # Of the delivered image; "bgr8"
    exposure: float = 0.0  # Time in which the cylinder smears the picture [s]
    exposure_samples: int = 5  # Instants that the smear is the mean of
    defocus: float = 0.0  # Standard deviation of the blur [px of the delivered image]
    bayer: bool = False  # Whether each pixel sees one colour only and the others are interpolated

    def __post_init__(self) -> None:
        if not (math.isfinite(self.focal) and self.focal > 0.0):
            raise ValueError(f"focal must be positive, got {self.focal} px")
        if self.encoding != BGR8:
            raise ValueError(f"encoding must be {BGR8!r}, got {self.encoding!r}")
        if not 1 <= self.supersampling <= 16:
            raise ValueError(f"supersampling must lie in 1 to 16, got {self.supersampling}")
        for name in ("exposure", "defocus"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} must not be negative, got {value}")
        if self.exposure_samples < 1:
            raise ValueError(f"exposure_samples must be at least 1, got {self.exposure_samples}")
        window = self.window
        if window.x_offset + window.width > self.width:
            raise ValueError(
                f"the window ends at column {window.x_offset + window.width} "
                f"of a sensor of {self.width}"
            )
        if window.y_offset + window.height > self.height:
            raise ValueError(
                f"the window ends at row {window.y_offset + window.height} "
                f"of a sensor of {self.height}"
            )

    def full_frame(self, binning: int = 1) -> CameraConfig:
        """Return the same camera delivering its whole sensor."""
        whole = Window(
            x_offset=0,
            y_offset=0,
            width=self.width - self.width % binning,
            height=self.height - self.height % binning,
            binning=binning,
        )
        return replace(self, window=whole)

    def calibration(self) -> CameraCalibration:
        """Return the content of the camera's CameraInfo."""
        window = self.window
        return CameraCalibration(
            width=self.width,
            height=self.height,
            distortion_model=PLUMB_BOB,
            d=np.array(self.distortion),
            k=np.array(
                [
                    [self.focal, 0.0, self.centre[0]],
                    [0.0, self.focal, self.centre[1]],
                    [0.0, 0.0, 1.0],
                ]
            ),
            roi=(window.x_offset, window.y_offset, window.width, window.height),
            binning=window.binning,
        )
