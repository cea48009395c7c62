"""Tracker: frames and encoder readings in, marker records out."""

from __future__ import annotations

import math
from typing import cast

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.camera.pinhole import PinholeCamera
from marker_tracker_node.detection.colour import ColourModel, ColourRefusedError
from marker_tracker_node.detection.zeroing import zeroed_pose
from marker_tracker_node.tracking.batch import advance_all
from marker_tracker_node.tracking.colour_sampling import NEAR_START, locate_marker, sample_colour
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.refinement import Sightings
from marker_tracker_node.tracking.report import FrameFault, TrackerReport
from marker_tracker_node.tracking.state import (
    ANGLE,
    BLIND,
    HEIGHT,
    O_AZIMUTH,
    O_FLAGS,
    O_HEIGHT,
    O_HIGH,
    O_LOW,
    O_SEEN,
    O_SIGMA_HEIGHT,
    O_SIGMA_THETA,
    O_SLOPE,
    O_THETA,
    OUTPUT_SIZE,
    STARTED,
    STATUS,
    THETA,
    TIME,
    VAR_HEIGHT,
    VAR_THETA,
    WEIGHT,
    WRAPS,
    TrackerState,
)
from winding_core.markers import MarkerFlag, Markers, wound_markers

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]


class Tracker:
    """Follow the markers of one winding run.

    Wound angles are taken from P0 in the same frame while P0 is in sight, which cancels encoder,
    clock and camera drift; otherwise from the encoder and P0's known place. Whole turns come from
    the encoder, identity from the order of winding.
    """

    def __init__(
        self,
        config: TrackerConfig,
        camera: PinholeCamera,
        colour: ColourModel | None = None,
        *,
        remember: bool = False,
    ) -> None:
        """Start a run.

        Args:
            config: Machine, cable and camera pose.
            camera: What CameraInfo says.
            colour: Of the markers; None to sample P0 in the first frames, where the cylinder
                angle is still near zero.
            remember: Whether to keep every sighting for `sightings`; 80 bytes a marker and frame.
        """
        self.config = config
        self.camera = camera
        self.colour = colour
        self.state = TrackerState.fresh(config.marker_count)
        self.pose = config.pose
        self._numbers = config.numbers()
        self._view = camera.numbers(config.pose)
        self._zeroed = False
        self._memory: list[tuple[FloatArray, FloatArray]] | None = [] if remember else None
        self._ids = np.arange(config.marker_count + 1)
        self._frames = 0
        self._rejected = dict.fromkeys(FrameFault, 0)
        self._losses = 0
        self._measured = 0
        self._slipped: tuple[int, ...] = ()
        self._refusal = "" if colour is not None else "no frame with P0 yet"

    def track(
        self,
        frame: ByteArray,
        t: float,
        cylinder_angle: float | None,
        guide_z: float | None = None,
    ) -> Markers:
        """Return the records of P0 to Pn for one frame.

        A marker that is not known yet has nan for numbers and the flag NOT_WOUND; one that is
        not seen in this frame keeps its run mean and is flagged PREDICTED.

        Args:
            frame: Blue-green-red, uint8 of shape (rows, columns, 3).
            t: Time of exposure [s].
            cylinder_angle: Encoder reading at t [rad], whole turns may be missing; None while
                the encoder is out.
            guide_z: Guide position at t [m]; None to expect the commanded feed.

        Returns:
            Records of MARKER_DTYPE, shape (marker_count + 1,); shape (0,) for a refused frame,
            which `report` counts.
        """
        fault = self._fault(frame, t)
        if fault is not None:
            self._rejected[fault] += 1
            return self._records(np.empty((0, OUTPUT_SIZE)), 0.0)
        angle = _believed(cylinder_angle, _MOST_ANGLE)
        if self.colour is None:
            self._learn(frame, angle)
        if not self._zeroed:
            self._zero(frame, angle)
        out, _ = self._advance(
            np.asarray(frame)[None],
            np.array([t]),
            np.array([angle]),
            np.array([_believed(guide_z, _MOST_GUIDE)]),
        )
        return self._records(out[0], float(self.state.shared[ANGLE]))

    def process(
        self,
        frames: ByteArray,
        times: FloatArray,
        cylinder_angles: FloatArray,
        guide_z: FloatArray | None = None,
    ) -> Markers:
        """Return the records of a burst of frames, as `track` would one after the other.

        Args:
            frames: uint8 of shape (k, rows, columns, 3).
            times: Ascending times [s], shape (k,).
            cylinder_angles: Encoder readings [rad], nan where missing, shape (k,).
            guide_z: Guide positions [m], shape (k,).

        Returns:
            Records of MARKER_DTYPE, shape (k, marker_count + 1).

        Raises:
            ValueError: The arrays do not fit each other or the camera, times do not ascend, or
                no colour is known.
        """
        self._require_burst(frames, times, cylinder_angles)
        if self.colour is None:
            raise ValueError(f"a burst needs a colour model: {self._refusal}")
        guide = np.full(len(frames), math.nan) if guide_z is None else guide_z
        out, angles = self._advance(frames, times, cylinder_angles, np.asarray(guide, dtype=float))
        flat = self._records(out.reshape(-1, OUTPUT_SIZE), np.repeat(angles, out.shape[1]))
        return flat.reshape(out.shape[:2])

    def estimates(self) -> Markers:
        """Return what the run says of each marker so far, its mean over all frames."""
        marks = self.state.marks
        known = marks[:, STATUS] > 0.0
        out = np.full((len(marks), OUTPUT_SIZE), math.nan)
        out[:, O_FLAGS] = float(MarkerFlag.NOT_WOUND)
        weight = np.sqrt(np.maximum(marks[:, WEIGHT], 1.0))
        out[known, O_THETA] = marks[known, THETA]
        out[known, O_HEIGHT] = marks[known, HEIGHT] - marks[0, HEIGHT]
        out[known, O_SIGMA_THETA] = (np.sqrt(marks[:, VAR_THETA]) / weight)[known]
        out[known, O_SIGMA_HEIGHT] = (np.sqrt(marks[:, VAR_HEIGHT]) / weight)[known]
        out[known, O_FLAGS] = 0.0
        return self._records(out, float(self.state.shared[ANGLE]))

    def sightings(self) -> Sightings:
        """Return every measured band so far, for `refine`.

        Raises:
            ValueError: The tracker was not told to remember them.
        """
        if self._memory is None:
            raise ValueError("the tracker keeps no sightings: start it with remember=True")
        angles = np.concatenate([np.empty(0), *(angles for angles, _ in self._memory)])
        out = np.concatenate(
            [np.empty((0, len(self._ids), OUTPUT_SIZE)), *(out for _, out in self._memory)]
        )
        frame, marker = np.nonzero(np.isfinite(out[..., O_AZIMUTH]))
        kept = out[frame, marker]
        return Sightings(
            marker=marker,
            angle=angles[frame],
            azimuth=kept[:, O_AZIMUTH],
            z=kept[:, O_SEEN],
            slope=kept[:, O_SLOPE],
            low=kept[:, O_LOW],
            high=kept[:, O_HIGH],
            pose=self.pose,
        )

    def report(self) -> TrackerReport:
        """Return counts and situation for diagnostics."""
        separation = math.nan if self.colour is None else self.colour.separation
        return TrackerReport(
            frames=self._frames,
            rejected=dict(self._rejected),
            known=int((self.state.marks[:, STATUS] > 0.0).sum()),
            measured=self._measured,
            slipped=self._slipped,
            encoder_lost=bool(self.state.shared[BLIND] > 0.0),
            encoder_losses=self._losses,
            encoder_wraps=round(self.state.shared[WRAPS] / (2.0 * math.pi)),
            colour_refusal=self._refusal,
            colour_separation=separation,
        )

    def _fault(self, frame: ByteArray, t: float) -> FrameFault | None:
        frame = np.asarray(frame)
        if frame.size == 0:
            return FrameFault.EMPTY
        if frame.dtype != np.uint8 or frame.ndim != 3 or frame.shape[2] != 3:
            return FrameFault.WRONG_ENCODING
        if frame.shape[:2] != self.camera.shape:
            return FrameFault.WRONG_SIZE
        if not math.isfinite(t):
            return FrameFault.NOT_A_TIME
        if self.state.shared[STARTED] > 0.0:
            if t == self.state.shared[TIME]:
                return FrameFault.DUPLICATE
            if t < self.state.shared[TIME]:
                return FrameFault.OUT_OF_ORDER
        return None

    def _require_burst(self, frames: ByteArray, times: FloatArray, angles: FloatArray) -> None:
        if frames.dtype != np.uint8 or frames.shape[1:] != (*self.camera.shape, 3):
            raise ValueError(
                f"frames must be uint8 of shape (k, {self.camera.shape[0]}, "
                f"{self.camera.shape[1]}, 3), got {frames.dtype} {frames.shape}"
            )
        if times.shape != (len(frames),) or angles.shape != times.shape:
            raise ValueError(
                f"{len(frames)} frames need as many times and angles, got {times.shape} "
                f"and {angles.shape}"
            )
        first = self.state.shared[TIME] if self.state.shared[STARTED] > 0.0 else -math.inf
        if len(times) and not (np.diff(times, prepend=first) > 0.0).all():
            raise ValueError(f"times must ascend from the last frame's {first} s")

    def _learn(self, frame: ByteArray, angle: float) -> None:
        try:
            self.colour = sample_colour(
                frame, self.config, self._view, 0.0 if math.isnan(angle) else angle
            )
        except ColourRefusedError as refusal:
            self._refusal = str(refusal)
        else:
            self._refusal = ""

    def _zero(self, frame: ByteArray, angle: float) -> None:
        """Turn the nominal pose until P0 stands where it is known to stand at the start."""
        if self.colour is None or not abs(angle) < NEAR_START:
            return
        try:
            pixel = locate_marker(frame, self.colour, self.config, self._view, angle)
        except ColourRefusedError:
            # Hidden now; until a frame shows P0 the nominal pose stands.
            return
        self.pose = zeroed_pose(self.camera, self.pose, self._numbers, pixel, angle)
        self._view = self.camera.numbers(self.pose)
        self._zeroed = True

    def _advance(
        self, frames: ByteArray, times: FloatArray, angles: FloatArray, guides: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        out = np.empty((len(frames), self.config.marker_count + 1, OUTPUT_SIZE))
        used = np.empty(len(frames))
        table = _NO_COLOUR if self.colour is None else self.colour.table
        before = self.state.shared[BLIND]
        state = self.state
        # Frames from messages are read-only; one kind of array means one compilation.
        still = np.ascontiguousarray(frames).view()
        still.flags.writeable = False
        advance_all(
            still,
            table,
            self._view,
            self._numbers,
            state.shared,
            state.marks,
            state.candidates,
            state.path,
            times,
            angles,
            guides,
            used,
            out,
        )
        if self._memory is not None:
            self._memory.append((used, out.copy()))
        self._frames += len(frames)
        blind = np.isnan(angles).astype(float)
        self._losses += int((np.diff(blind, prepend=before) > 0.0).sum())
        if len(out):
            flags = out[-1, :, O_FLAGS].astype(int)
            unseen = int(MarkerFlag.PREDICTED | MarkerFlag.NOT_WOUND)
            self._measured = int(((flags & unseen) == 0).sum())
            self._slipped = tuple(np.flatnonzero(flags & int(MarkerFlag.SLIPPED)).tolist())
        return out, used

    def _records(self, out: FloatArray, angle: float | FloatArray) -> Markers:
        return wound_markers(
            ids=np.resize(self._ids, len(out)),
            theta=out[:, O_THETA],
            z=out[:, O_HEIGHT],
            radius=self.config.centreline_radius,
            cylinder_angle=cast(float, angle),
            sigma_theta=out[:, O_SIGMA_THETA],
            sigma_z=out[:, O_SIGMA_HEIGHT],
            flags=out[:, O_FLAGS].astype(np.uint32),
        )


_NO_COLOUR = np.zeros(32**3, dtype=np.uint8)


# No machine comes so far [rad, m]; the search looks at every lap up to the present angle.
_MOST_ANGLE, _MOST_GUIDE = 1.0e5, 100.0


def _believed(value: float | None, most: float) -> float:
    """Return a reading, or nan where there is none that a machine could give."""
    return float(value) if value is not None and abs(value) <= most else math.nan
