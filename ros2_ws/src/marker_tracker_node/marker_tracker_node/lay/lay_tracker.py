"""The whole lay of a run: frames in, every turn out."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.pinhole import PinholeCamera
from marker_tracker_node.lay.config import LayConfig
from marker_tracker_node.lay.free_span import FreeLength, FreeSpan
from marker_tracker_node.lay.report import LayReport, defects_of, lay_records
from marker_tracker_node.lay.rows import PoseDoubt, choose_rows
from marker_tracker_node.lay.span_alignment import span_in
from marker_tracker_node.lay.turn_map import TurnMap, led_on
from marker_tracker_node.lay.wound_rows import Moment, take_row
from winding_core.lay.records import LayRecords

SPAN_STEPS = 1.0  # The free span changes more slowly than there is new cable
# A span whose angle is known no better is none [rad], nor one that fewer of its rows show.
MOST_DOUBT, MOST_ROWS = 2.5e-3, 0.6
STEEPEST = 0.5  # No cable is laid with a greater slope, dz per way
# How far the slope of a straight cable to the guide may be off, and the share by which its length.
OFF_GUIDE, LENGTH_DOUBT = 0.02, 0.25
SPAN_MEMORY = 0.5  # A span that was seen so long ago may be anywhere [rad]

ByteArray = NDArray[np.uint8]
FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class LayReading:
    """Where the machine stands in a frame."""

    cylinder_angle: float  # Azimuth of P0, whole turns included [rad]
    guide_z: float = math.nan  # [m], nan if unknown


class LayTracker:
    """Measures every turn on the cylinder, and the free span, in the frames of a run.

    A row of the picture is measured again when the cylinder has turned by `LayConfig.step`, so the
    work is bounded by turning, not by frames.
    """

    def __init__(self, config: LayConfig, camera: PinholeCamera) -> None:
        """Start a run."""
        self.config = config  # Machine and limits
        self._machine = config.machine
        self.span: FreeSpan | None = None  # The free span as it was seen last, None before that
        # Whether the camera's pose was turned until P0 stood where it must, which is then known
        # better than by `LayConfig.belief`.
        self.anchored = False
        self._shape = camera.shape
        self._wound, self._free = choose_rows(
            camera.view(config.pose),
            camera.shape,
            rho=config.rho,
            cable_radius=config.cable_radius,
            azimuths=config.azimuths,
            widest=config.widest,
            ways=config.ways,
            longest=config.longest,
        )
        self._wound_at = [math.nan] * self._wound.row.size
        self._free_at = math.nan
        self._span_at = math.nan
        self._doubt = PoseDoubt(
            camera, config.pose, config.belief, rho=config.rho, rows=self._wound
        )
        self._turns = TurnMap()
        self._length = FreeLength(config.roll_doubt)
        self._angle = math.nan

    @property
    def angle(self) -> float:
        """Azimuth of P0 in the last frame [rad], nan before it."""
        return self._angle

    def take(self, frame: ByteArray, reading: LayReading) -> int:
        """Measure what is due in a frame and return the number of turns that were seen.

        Args:
            frame: Blue-green-red, uint8 of shape (rows, columns, 3).
            reading: Where the machine stands.

        Raises:
            ValueError: The frame has another size than the camera's.
        """
        if frame.shape[:2] != self._shape:
            raise ValueError(f"frame must have the shape {self._shape}, got {frame.shape[:2]}")
        angle = reading.cylinder_angle
        if not math.isfinite(angle):
            return 0
        self._angle = angle
        # Frames from messages are read-only; one kind of array means one compilation.
        still = np.ascontiguousarray(frame).view()
        still.flags.writeable = False
        step = self.config.turning
        if not abs(angle - self._free_at) < SPAN_STEPS * step:
            self._free_at = angle
            self._take_free(still, reading)
        number = 0
        for k, at in enumerate(self._wound_at):
            if not abs(angle - at) < step:
                # After the first frame each has its turn.
                fresh = step * k / len(self._wound_at) if math.isnan(at) else 0.0
                self._wound_at[k] = angle - fresh
                number += self._take_wound(still, k, reading)
        return number

    def report(self) -> LayReport:
        """Return everything that is known of the lay; see `LayReport`."""
        records = self.records()
        length, sigma = self._length.value
        return LayReport(
            records=records,
            defects=tuple(sorted(defects_of(records), key=lambda defect: defect.first)),
            span=self.span,
            free_length=length,
            sigma_free_length=sigma,
        )

    def records(self, newest: int | None = None) -> LayRecords:
        """Return the lay as records of LAY_DTYPE, by rising wound angle.

        Args:
            newest: Turns at the end that are returned, None for all.
        """
        return lay_records(self.config, self._turns, self._angle, newest, self._pose_sigma)

    def _pose_sigma(self, z: FloatArray) -> FloatArray:
        slope = self.config.advance_per_radian
        return self._doubt.sigma(z, slope, anchored=self.anchored)

    def _slope(self) -> float:
        """Return dz/dtheta of the cable that lands now [m/rad]."""
        if self.span is not None:
            return self.span.slope * self.config.rho
        return 0.5 * self.config.advance_per_radian

    def _landing(self, angle: float) -> float:
        """Return where the cable lands [m], nan if that was not seen lately."""
        if self.span is None or abs(angle - self._span_at) > SPAN_MEMORY:
            return math.nan
        return self.span.contact_z

    def _take_wound(self, frame: ByteArray, k: int, reading: LayReading) -> int:
        angle = reading.cylinder_angle
        # P0's clamped tail ends before it, the newest cable at the contact line.
        self._turns.reserve(angle)
        moment = Moment(
            angle=angle,
            slope=self._slope(),
            landing=self._landing(angle),
            guide=reading.guide_z,
            farthest=self._farthest(reading),
        )
        return int(take_row(frame, self._wound, k, self._turns.places, self._machine, moment))

    def _farthest(self, reading: LayReading) -> float:
        """Return how far along the cylinder there can be cable [m]: up to the guide or the span."""
        guide, landing = reading.guide_z, self._landing(reading.cylinder_angle)
        if not math.isfinite(guide):
            guide = self.config.advance_per_radian * reading.cylinder_angle
        ahead = self.config.onward * guide
        if math.isfinite(landing):
            ahead = max(ahead, self.config.onward * landing)
        return ahead + self.config.diameter

    def _take_free(self, frame: ByteArray, reading: LayReading) -> None:
        """Measure the free span, if its rows show one."""
        if self._free.row.size < 3:
            return
        config, angle = self.config, reading.cylinder_angle
        guide = reading.guide_z
        if not math.isfinite(guide):
            guide = config.advance_per_radian * angle
        start = slope = math.nan
        if self.span is not None and abs(angle - self._span_at) < SPAN_MEMORY:
            start = led_on(self._turns.places, angle, reading.guide_z, self._machine)
            if not math.isfinite(start):
                start = self._turns.near(angle, SPAN_MEMORY, self._slope())
            start, slope = start if math.isfinite(start) else self.span.contact_z, self.span.slope
        # P0 lies at zero.
        last, since = (0.0, 0.0) if self.span is None else (self.span.contact_z, self._span_at)
        reach = 3.0 * config.diameter + STEEPEST * config.rho * abs(angle - since)
        for begin in ((start, slope), (math.nan, math.nan)):
            found = span_in(frame, self._free, *begin, guide, last, reach, self._machine)
            span = FreeSpan(*found)
            if self._leads_to(span, reading.guide_z):
                break
        else:
            return
        self._span_at = angle
        pose, z = config.pose.position, span.contact_z
        steep = (z - pose[2]) / (pose[0] - config.rho)
        sigma, slope = span.sigma_contact_z, self._slope()
        over = self._turns.lies_on_others(angle, z, config.overlap_limit * config.diameter)
        if not over and not abs(z - start) < 0.5 * config.diameter:
            # Rows would go on where an older turn was taken for this one.
            self._turns.add(angle, z, slope=slope, sigma=sigma, floor=0.0, whole=True, steep=steep)
        if over:
            # What lies higher looks farther from the middle of the picture than it is.
            self.span = span._replace(sigma_contact_z=math.hypot(sigma, steep * config.diameter))
            return
        self.span = span
        if math.isfinite(reading.guide_z):
            self._length.add(span, reading.guide_z)

    def _leads_to(self, span: FreeSpan, guide: float) -> bool:
        """Return whether a span is well seen and leads to where the guide stands [m], if known."""
        if span.rows < MOST_ROWS * self._free.row.size or span.sigma_angle > MOST_DOUBT:
            return False
        straight = (guide - span.contact_z) / self.config.free_length
        return not abs(span.slope - straight) > OFF_GUIDE + LENGTH_DOUBT * abs(straight)
