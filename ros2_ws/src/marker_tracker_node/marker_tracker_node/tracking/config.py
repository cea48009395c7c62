"""What the tracker needs to know of the machine, the cable and the camera's place."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from marker_tracker_node.camera.pinhole import CameraPose, CameraView
from marker_tracker_node.detection.band import Body
from marker_tracker_node.detection.detectors import detector_number
from marker_tracker_node.tracking.state import Setup
from winding_core.cable.condition import ResolvedCondition
from winding_core.helix import PAPER_FREE_LENGTH, FleetAngleLaw
from winding_core.machine.drive import PAPER_ANGULAR_SPEED, PAPER_FEED_SPEED
from winding_core.markers import BAND, DOT, MarkerParameters
from winding_core.run_options import CameraPlacement


@dataclass(frozen=True, kw_only=True)
class TrackerConfig:
    """Configuration of a tracker.

    Attributes:
        expected_stretch: Deformed over undeformed cable length; it distinguishes a late marker
            from a missed one, the measured gaps correct it.
        dot_size: Side of the square printed on the outside of the cable that a marker is instead
            of a ring band [m]; 0 for ring bands.
        dot_torsion: Twist of the cable about itself at a dot, one standard deviation [rad].
        advance_per_radian: Expected feed per radian of rotation [m/rad].
        usable_azimuth: Largest angle from the contact line at which a band is measured [rad].
        marker_hues: Of P0, P1 and so on, where they differ [deg]; the last one holds for all
            further markers. Empty where all have marker_hue.
        start_angle: Azimuth of P0 at the first frame with an encoder reading, whole turns
            included [rad]; None to find out.
        row_time: From an image row to the next [s]; negative where the lowest is read first.
    """

    cylinder_radius: float  # R [m]
    cable_radius: float  # r [m]
    marker_spacing: float  # Of the undeformed cable [m]
    marker_count: int = 4  # Markers after P0
    expected_stretch: float = 1.0
    band_width: float = 6.0e-3  # Of a ring band along the cable [m]
    marker_kind: str = BAND  # See `DETECTORS`
    dot_size: float = 0.0
    dot_torsion: float = 0.0
    pose: CameraPose = field(default_factory=CameraPose)  # Where the camera stands
    advance_per_radian: float = PAPER_FEED_SPEED / PAPER_ANGULAR_SPEED
    free_length: float = PAPER_FREE_LENGTH  # Of the span between guide and contact line [m]
    usable_azimuth: float = math.radians(62.0)
    along_margin: float = 0.8e-3  # Room of a gate along the cable [m]
    across_margin: float = 0.6e-3  # Room of a gate across the cable [m]
    search_width: float = 4.5e-3  # Half width of the search for a marker that was not seen yet [m]
    slip_limit: float = 0.03  # Wandering of a wound angle that counts as slip [rad]
    marker_hue: float = 50.0  # Hue around which a marker is sought to sample its colour [deg]
    marker_hue_tolerance: float = 22.0  # Half width of that range [deg]
    marker_hues: tuple[float, ...] = ()
    start_angle: float | None = None
    row_time: float = 0.0

    @classmethod
    def of(
        cls,
        what: ResolvedCondition,
        where: CameraPlacement | None = None,
        markers: MarkerParameters | None = None,
        *,
        row_time: float = 0.0,
    ) -> TrackerConfig:
        """Return the configuration that parameters mean.

        Args:
            what: Is wound.
            where: The camera stands; None for the parameters' defaults.
            markers: What they look like; None for the parameters' defaults.
            row_time: See `TrackerConfig` [s].
        """
        case, drive = what.case, what.drive
        where, markers = where or CameraPlacement(), markers or MarkerParameters()
        return cls(
            cylinder_radius=case.cylinder_radius,
            cable_radius=case.cable_radius,
            marker_spacing=case.marker_spacing,
            marker_count=case.marker_count,
            expected_stretch=case.expected_stretch,
            band_width=markers.band_width,
            marker_kind=markers.marker_kind,
            dot_size=markers.dot_size if markers.marker_kind == DOT else 0.0,
            dot_torsion=markers.dot_torsion if markers.marker_kind == DOT else 0.0,
            pose=CameraPose(
                position=_triple(where.camera_position), tilt=_triple(where.camera_tilt)
            ),
            advance_per_radian=drive.advance_per_radian,
            free_length=what.free_length,
            marker_hue=(markers.hues or (markers.marker_hue,))[0],
            marker_hues=markers.hues,
            marker_hue_tolerance=markers.marker_hue_tolerance,
            start_angle=markers.start_angle or None,
            row_time=row_time,
        )

    def __post_init__(self) -> None:
        for name in (
            "cylinder_radius",
            "cable_radius",
            "marker_spacing",
            "expected_stretch",
            "band_width",
            "free_length",
            "search_width",
            "slip_limit",
        ):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be positive and finite, got {value}")
        detector_number(self.marker_kind)
        if self.marker_count < 1:
            raise ValueError(f"marker_count must be at least 1, got {self.marker_count}")
        if not 0.1 <= self.usable_azimuth <= 1.4:
            raise ValueError(
                f"usable_azimuth must lie in 0.1 to 1.4 rad, got {self.usable_azimuth}"
            )

    @property
    def centreline_radius(self) -> float:
        """R + r [m]."""
        return self.cylinder_radius + self.cable_radius

    @property
    def expected_gap(self) -> float:
        """Wound angle between neighbouring markers [rad]."""
        return self.marker_spacing * self.expected_stretch / self.centreline_radius

    @property
    def law(self) -> FleetAngleLaw:
        """Where the cable lands behind a guide that keeps in step with the cylinder."""
        return FleetAngleLaw(
            advance_per_radian=self.advance_per_radian,
            free_length=self.free_length,
            radius=self.centreline_radius,
        )

    @property
    def hues(self) -> tuple[float, ...]:
        """Hue of each marker [deg], shape (marker_count + 1,)."""
        given = self.marker_hues or (self.marker_hue,)
        count = self.marker_count + 1
        return (given + given[-1:] * count)[:count]

    @property
    def body(self) -> Body:
        """What the bands are painted on, for the kernels."""
        dot = self.dot_size > 0.0
        around = 0.5 * self.dot_size / self.cable_radius
        return Body(
            rho=float(self.centreline_radius),
            cable_radius=float(self.cable_radius),
            half_band=0.5 * (self.dot_size if dot else self.band_width),
            half_around=min(around, math.pi) if dot else math.pi,
        )

    def setup(self, camera: CameraView) -> Setup:
        """Return what the kernels need of a run that is seen by a camera."""
        return Setup(
            camera=camera,
            body=self.body,
            usable_azimuth=float(self.usable_azimuth),
            along_margin=float(self.along_margin),
            across_margin=float(self.across_margin),
            search_width=float(self.search_width),
            slip_limit=float(self.slip_limit),
            expected_gap=float(self.expected_gap),
            lag=self.law.lag_angle,
            advance_per_radian=float(self.advance_per_radian),
            row_time=float(self.row_time),
            torsion=float(self.dot_torsion),
            detector=detector_number(self.marker_kind),
        )


def _triple(values: list[float]) -> tuple[float, float, float]:
    x, y, z = values
    return x, y, z
