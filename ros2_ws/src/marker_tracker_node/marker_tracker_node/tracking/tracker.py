"""Tracker: frames and encoder readings in, marker records out."""

from __future__ import annotations

import math
from functools import partial
from typing import cast

import numpy as np

from marker_tracker_node.arrays import ByteArray, FloatArray
from marker_tracker_node.camera.pinhole import CameraPose, PinholeCamera
from marker_tracker_node.detection.colour import ColourModel
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.estimator.correction import Correction
from marker_tracker_node.tracking.estimator.numbers import (
    COUNT,
    TILT,
    body_without,
    camera_without,
    pose_without,
)
from marker_tracker_node.tracking.estimator.problem import ANGLE, TIME, Seen
from marker_tracker_node.tracking.frame.frame_update import update_burst
from marker_tracker_node.tracking.frame.run_means import mean_variances
from marker_tracker_node.tracking.machine_motion import MotionBefore
from marker_tracker_node.tracking.recalibration import Recalibration, measure_again, turned
from marker_tracker_node.tracking.refinement import Sightings
from marker_tracker_node.tracking.report import (
    FrameFault,
    RunChecks,
    TrackerReport,
    crossing,
    guide_doubt,
    missing_markers,
)
from marker_tracker_node.tracking.run_start import RunStart
from marker_tracker_node.tracking.sighting_log import SightingLog
from marker_tracker_node.tracking.state import Burst, Setup, TrackerState, fixed_numbers
from winding_core.markers import MarkerFlag, Markers, wound_markers

_UNSEEN = int(MarkerFlag.PREDICTED | MarkerFlag.NOT_WOUND)
# No machine comes so far [rad, m]; the search looks at every lap up to the present angle.
_FARTHEST = 1.0e5


class Tracker:
    """Follow the markers of one winding run.

    Wound angles are taken from P0 in the same frame while P0 is in sight, which cancels encoder,
    clock and camera drift; otherwise from the encoder and P0's known place. Whole turns come from
    the encoder, identity from the order of winding.

    As markers pass all that was seen is explained by one least squares, see `estimator`; what
    that corrects of the configured numbers is measured with from then on. Published values go over
    to it in steps of half their deviation.

    Attributes:
        config: Machine, cable and nominal camera pose.
        camera: Content of CameraInfo.
        state: Of the run.
        beginnings: How often it began anew, azimuths before which are worth nothing.
        seen: Azimuths of the bands in the last frame of `track` as the configured numbers have
            them [rad], nan where not measured.
    """

    def __init__(
        self,
        config: TrackerConfig,
        camera: PinholeCamera,
        colour: ColourModel | None = None,
        *,
        motion_before: FloatArray | None = None,
    ) -> None:
        """Start a run.

        Args:
            config: Machine, cable and camera pose.
            camera: Content of CameraInfo.
            colour: Of the markers; None to learn it from P0.
            motion_before: Times [s], encoder readings [rad] and guide positions [m] of the run
                before the first frame, shape (3, n); None where the frames begin with the run.
        """
        self.config = config
        self.camera = camera
        self._motion = MotionBefore(motion_before)
        self._start = RunStart(config, camera, colour)
        self.beginnings = 0
        self._ids = np.arange(config.marker_count + 1)
        self._begin()
        # How many frames were used, and how many of them when they were explained last.
        self._frames, self._explained_at = 0, -1
        self._rejected = dict.fromkeys(FrameFault, 0)
        self._losses = 0
        self._flags = np.full(len(self._ids), MarkerFlag.NOT_WOUND, dtype=np.uint32)
        self.seen = np.full(len(self._ids), np.nan)

    def _begin(self) -> None:
        """Know nothing of what was measured."""
        self.state = TrackerState.fresh(self.config.marker_count)
        self._log, self._checks = SightingLog(), RunChecks()
        self._numbers = Recalibration(len(self._ids))
        self._setup = self.config.setup(self.camera.view(self.pose))
        self._fixed = fixed_numbers(self._setup)

    @property
    def colour(self) -> ColourModel | None:
        """Colour of the markers; None until it is learnt."""
        return self._start.colour

    @property
    def pose(self) -> CameraPose:
        """The camera's pose: turned until P0 stands where it must, or as it is corrected."""
        if self._numbers.made:
            return pose_without(self.config.pose, self._numbers.errors)
        return self.begun

    @property
    def begun(self) -> CameraPose:
        """The pose that P0 has given, without what the estimator corrects."""
        return self._start.zero.pose

    @property
    def lens(self) -> PinholeCamera:
        """The camera with its focal length as it is corrected."""
        return camera_without(self.camera, self._numbers.errors)

    @property
    def zeroed(self) -> bool:
        """Whether the picture of P0 has given the camera's turn."""
        return self._start.zero.found

    @property
    def origin(self) -> float:
        """What the encoder reads where the wound angle is zero [rad]."""
        return self._start.origin

    def track(
        self,
        frame: ByteArray,
        t: float,
        cylinder_angle: float | None,
        guide_z: float | None = None,
        *,
        lead: float = 0.0,
        beside: float = 0.0,
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
            lead: How much further than by the reading P0 is expected, in azimuths as in `seen`
                [rad].
            beside: How far beside that it is sought if it is not there [rad].

        Returns:
            Records of MARKER_DTYPE, shape (marker_count + 1,); shape (0,) for a refused frame,
            which `report` counts.
        """
        fault = self._fault(frame, t)
        if fault is not None:
            return self.refuse(fault)
        angle = _possible(cylinder_angle)
        guide = _possible(guide_z)
        if not self._start.done:
            if self._start.take(
                frame, self._setup, angle, guide, self.state, partial(self._path, t)
            ):
                self.beginnings += 1
                self._begin()
                self._start.begin(self.state)
            elif not self.state.marks.known[0]:
                self.state.mark_rows["height"][0] = self._start.height
        out = self._advance(
            np.asarray(frame)[None],
            np.array([[t], [angle - self.origin], [guide], [lead], [beside]]),
        )
        self.seen = self._numbers.as_begun(out.rows[0], self._setup)[:, 0]
        if not self._start.done:
            self._motion.add(t, angle, guide)
            if self._start.saw(t, out):
                self._turn_camera()
        records: Markers = self._records(out)[0]
        return records

    def refuse(self, fault: FrameFault) -> Markers:
        """Count a frame that is not used; return no records, shape (0,)."""
        self._rejected[fault] += 1
        self.seen = np.full(len(self._ids), np.nan)
        return self._records(Burst.empty(0, len(self._ids))).ravel()

    @property
    def phase(self) -> float:
        """By how much the azimuth of P0, as in `seen`, exceeds a reading of the encoder [rad]."""
        return self.state.shift - self.origin - self._numbers.moved

    def rebase(self, shift: float, *, forget: bool) -> None:
        """Take another azimuth of P0 at encoder angle zero, as in `seen` [rad].

        Forget what was found of P1 and later where that rests on wrong readings.
        """
        self.state.run.shift = shift + self._numbers.moved - self._numbers.ahead
        if forget:
            self.state.mark_rows["known"][1:] = False
            self.state.candidate_rows["hits"] = 0

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
            raise ValueError(f"a burst needs a colour model: {self._start.refusal}")
        readings = np.zeros((5, len(frames)))
        readings[0], readings[1] = times, cylinder_angles - self.origin
        readings[2] = math.nan if guide_z is None else guide_z
        return self._records(self._advance(frames, readings))

    def estimates(self) -> Markers:
        """Return what is known of each marker so far, its mean over all frames."""
        self._explain()
        marks = self.state.marks
        known = marks.known
        out = Burst.empty(1, len(known))
        out.angle[0] = self.state.run.cylinder.angle
        seen = out.seen
        seen.theta[0, known] = marks.theta[known]
        seen.height[0, known] = (marks.height - marks.height[0])[known]
        own = np.array([mean_variances(self._setup, marks, n) for n in range(len(known))])
        seen.sigma_theta[0, known], seen.sigma_height[0, known] = np.sqrt(own + own[0])[known].T
        seen.marker_flags[0, ~known] = MarkerFlag.NOT_WOUND
        estimates: Markers = self._records(out)[0]
        return estimates

    def sightings(self) -> Sightings:
        """Return the bands that the log keeps, for `refine`."""
        means, numbers = self.estimates(), self._numbers
        rows, pose, without = self._log.sightings.copy(), self.pose, numbers.errors
        if numbers.posed and numbers.begun is not None:
            # What `refine` finds is what is left of the pose with which the run began; whatever
            # scale was corrected beside that pose went with it.
            measure_again(rows, self._setup, numbers.begun)
            pose, without = self.begun, np.zeros_like(numbers.errors)
        elif numbers.turns:
            rows[:, ANGLE] += numbers.turned_ahead(self._log.motion, rows[:, [TIME, ANGLE]].T)
        return Sightings(
            rows=rows,
            pose=pose,
            without=without,
            means=np.array([means["theta"], means["z"]]),
        )

    def report(self) -> TrackerReport:
        """Return counts and situation for diagnostics."""
        self._explain()
        cylinder, marks = self.state.run.cylinder, self.state.marks
        separation = math.nan if self.colour is None else self.colour.separation
        return TrackerReport(
            frames=self._frames,
            rejected=dict(self._rejected),
            known=int(marks.known.sum()),
            measured=int(((self._flags & _UNSEEN) == 0).sum()),
            slipped=tuple(np.flatnonzero(self._flags & int(MarkerFlag.SLIPPED)).tolist()),
            encoder_lost=bool(cylinder.blind),
            encoder_losses=self._losses,
            encoder_wraps=round(cylinder.wraps / (math.tau)),
            colour_refusal=self._start.refusal,
            remarks=tuple(filter(None, (*self._start.sentences, self._numbers.remark))),
            colour_separation=separation,
            contradictions=self._checks.contradictions,
            missing=missing_markers(
                self._setup, self.state, p0_late=self._start.overdue(float(cylinder.angle))
            ),
            guide_doubt=guide_doubt(self._setup, self.state),
            crossing=crossing(self._setup, self.state),
            judged=self._checks.covers(self._log)
            and self._explained_at < self._frames
            and self._start.certain,
        )

    def explain(self) -> None:
        """Explain what was seen if there is news; the next frame is measured with it."""
        if self._explain():
            self._explained_at = self._frames

    def _explain(self) -> bool:
        done = self._checks.judge(self._log, self._setup, self.state, self._seen)
        found, marks = self._checks.correction, self.state.marks
        if not (done and self._start.proven):
            return done
        if found is None:
            if not self._numbers.made and self._checks.covers(self._log):
                marks.doubt_theta[:] = marks.doubt_height[:] = 0.0
            return True
        if self._numbers.changes(found, marks):
            self._recalibrate(found, self._without(found.errors))
            self._start.posed = True
        marks.doubt_theta[found.markers], marks.doubt_height[found.markers] = found.doubt
        return True

    def _turn_camera(self) -> None:
        """Measure with the pose that a pass of P0 has given."""
        errors = np.zeros(COUNT)
        errors[TILT : TILT + 6] = self.config.pose.numbers - self.pose.numbers
        setup = self._without(errors)
        self._recalibrate(turned(self.state.marks, errors, (self._setup, setup)), setup)

    def _without(self, errors: FloatArray) -> Setup:
        """Return machine and camera without errors of their numbers, shape (numbers,)."""
        camera, config = camera_without(self.camera, errors), self.config
        setup = config.setup(camera.view(pose_without(config.pose, errors)))
        return setup._replace(body=body_without(config.body, errors))

    def _recalibrate(self, found: Correction, setup: Setup) -> None:
        """Measure with other numbers from now on, and take what was measured as they have it."""
        old, self._setup = self._setup, setup
        self._fixed = fixed_numbers(setup)
        self._numbers.make(found, self.state, self._log, (old, setup))
        self.state.candidate_rows["hits"] = 0

    def _seen(self) -> Seen:
        """Return what the estimator explains."""
        area = self.state.marks.area[self.state.marks.known]
        area = area[area > 0.0]
        return Seen.of(
            rows=self._log.sightings,
            motion=self._log.motion,
            area=float(np.median(np.log(area))) + self._numbers.area if area.size else math.nan,
            begun=self.begun,
            without=self._numbers.errors,
            zeroed=self.origin == 0.0,
            camera=self.camera,
            used=self.pose,
            nominal=self.config.pose,
            body=self.config.body,
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
        if self.state.started and t <= self.state.time:
            return FrameFault.DUPLICATE if t == self.state.time else FrameFault.OUT_OF_ORDER
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
        first = self.state.time if self.state.started else -math.inf
        if len(times) and not (np.diff(times, prepend=first) > 0.0).all():
            raise ValueError(f"times must ascend from the last frame's {first} s")

    def _advance(self, frames: ByteArray, readings: FloatArray) -> Burst:
        """Take frames with their `readings`, see `update_burst`."""
        out = Burst.empty(len(frames), len(self._ids))
        palette = self._start.palette()
        state = self.state
        if len(frames) and not state.started:
            self._motion.take_up(state, self._fixed, readings[0, 0], self.origin)
        if self._numbers.turns:
            # Of the camera's clock alone less is known then.
            readings[3] = 0.0
            out.ahead[:] = self._numbers.turned_ahead(self._log.motion, readings[:2])
            readings[1] += out.ahead
        # Frames from messages are read-only; one kind of array means one compilation.
        still = np.ascontiguousarray(frames).view()
        still.flags.writeable = False
        missing = np.isnan(readings[1])
        if missing.any():
            before = not math.isnan(readings[1, 0]) or state.run.cylinder.blind
            self._losses += int((missing[1:] & ~missing[:-1]).sum()) + (not before)
        update_burst(
            still, palette.tables, palette.colour_of, self._fixed, state.run_rows,
            state.mark_rows, state.candidate_rows, state.paths, readings, out.angle, out.rows,
        )  # fmt: skip
        self._log.take(still, readings, out)
        self._frames += len(frames)
        if len(frames):
            self._numbers.ahead = float(out.ahead[-1])
            self._flags = out.rows["marker_flags"][-1]
        return out

    def _path(self, t: float, origin: float) -> FloatArray:
        """Return z of the cable by guide and by feed [m], see `Tracks`, laid up to a time t [s].

        The encoder reads `origin` where P0 lands [rad].
        """
        state = TrackerState.fresh(self.config.marker_count)
        self._motion.take_up(state, self._fixed, t, origin)
        return state.paths[:2, : state.run.path_filled]

    def _records(self, out: Burst) -> Markers:
        """Return records of shape (frames, markers)."""
        rows = out.rows
        return wound_markers(
            ids=self._ids,
            theta=rows["theta"],
            z=rows["height"],
            radius=self.config.centreline_radius,
            cylinder_angle=cast(float, out.angle[:, None]),
            sigma_theta=rows["sigma_theta"],
            sigma_z=rows["sigma_height"],
            flags=rows["marker_flags"],
        )


def _possible(value: float | None) -> float:
    """Return a reading, or nan where there is none that a machine could give."""
    return float(value) if value is not None and abs(value) <= _FARTHEST else math.nan
