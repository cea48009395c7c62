"""The beginning of a run: markers' colour, P0's place, encoder's zero, camera's turn."""

from __future__ import annotations

import math

import numpy as np

from marker_tracker_node.arrays import ByteArray
from marker_tracker_node.camera.pinhole import PinholeCamera
from marker_tracker_node.detection.colour import ColourModel, ColourRefusedError, Palette
from marker_tracker_node.tracking.camera_zero import CameraZero
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.estimator.fit import USUAL
from marker_tracker_node.tracking.frame.laid_path import (
    BAND_REACH,
    LAY_SIGMA,
    LOOK_STEP,
    PROOF_ADVANCE,
    SAME_ANGLE,
)
from marker_tracker_node.tracking.frame.run_means import BIAS
from marker_tracker_node.tracking.identity import Identified, Paths, identified
from marker_tracker_node.tracking.p0_search import (
    SEARCH_REACH,
    BandSearch,
    MovingBand,
    sample_colour,
)
from marker_tracker_node.tracking.start_doubts import (
    ALONG,
    MisplacedCamera,
    PictureDoubts,
    beside_its_place,
    colourless,
)
from marker_tracker_node.tracking.state import Burst, Setup, TrackerState
from winding_core.units import MILLIMETRE


class RunStart:
    """What has to be found out before markers can be followed.

    Attributes:
        colour: Of the markers; None until it is learnt.
        origin: What the encoder reads where the wound angle is zero [rad].
        height: Where P0 passes [m], as far as that is known.
        refusal: Why nothing can be followed; empty when something can.
        zero: The camera's turn.
        done: Whether there is nothing left to find out.
        posed: Whether the camera's pose is corrected by more than P0.
        proven: Whether P0 moved with the cylinder, or is sought no longer.
        certain: Whether no other marker can be what is taken for P0.
    """

    def __init__(
        self, config: TrackerConfig, camera: PinholeCamera, colour: ColourModel | None
    ) -> None:
        """Start with a nominal camera pose, and the markers' colour; None to learn it from P0."""
        self.colour = colour
        self.origin = self.height = 0.0
        self.refusal = "" if colour is not None else "no frame with P0 yet"
        self._remark = ""
        self.zero = CameraZero(config, camera)
        self.done = self.posed = False
        self._config, self._camera = config, camera
        self._search, self._all = BandSearch(config), BandSearch(config, 2.0 * ALONG)
        self._doubts = PictureDoubts(config)
        self._misplaced = MisplacedCamera(config)
        self._begun = self._looked = self._scanned = math.nan
        self._judged = self._set = 0.0
        self.certain = colour is not None
        self._identified: Identified | None = None
        self._followed = self.proven = colour is not None
        self._settled = False
        self._palette: tuple[ColourModel | None, Palette] | None = None

    def take(
        self,
        frame: ByteArray,
        setup: Setup,
        angle: float,
        guide: float,
        state: TrackerState,
        paths: Paths,
    ) -> bool:
        """Take a frame; return whether what was known of the markers before is void.

        The encoder's reading [rad] and the guide's position [m] are nan where they are missing;
        the state is that of the run so far.
        """
        void, self._paths = False, paths
        if math.isnan(self._begun) and math.isfinite(angle):
            self._begun = angle
            if self._config.start_angle is not None:
                self.origin = angle - self._config.start_angle
            self._set = self.origin
            # Then P0 is what lands first, and has its colour.
            self.certain &= abs(angle - self.origin) <= BAND_REACH
        at = angle - self.origin
        if self.colour is None:
            self._sample(frame, setup, 0.0 if math.isnan(at) else at)
        if math.isfinite(angle) and not abs(angle - self._looked) < LOOK_STEP:
            self._looked = angle
            void = self._ambiguous and self._identify(frame, setup, angle, guide, state)
            void |= not self.proven and self._look(frame, setup, angle, guide)
            void |= not self._misplaced.done and self._find_elsewhere(frame, setup, angle, guide)
        if self.colour is not None and not self.posed:
            void |= self.zero.take(frame, self.colour, setup, angle - self.origin)
        return void

    def saw(self, t: float, out: Burst) -> bool:
        """Take what a frame of time t [s] yielded; return whether the pose has changed."""
        turned = abs(float(out.angle[0]) + self.origin - self._begun)
        seen = math.isfinite(float(out.rows[0, 0]["azimuth"]))
        # What is still measured as P0 then moves with the cylinder.
        self._followed |= seen and turned > 2.0 * PROOF_ADVANCE
        changed = not self.posed and self.zero.saw(t, out)
        posed = self.posed or self.zero.done
        self.done = self.proven and not self._ambiguous and posed and self._misplaced.done
        return changed

    def overdue(self, angle: float) -> bool:
        """Return whether P0 should be known at a cylinder's angle [rad]: it came round twice."""
        return self.proven and abs(angle + self.origin - self._begun) > 2.0 * math.tau

    def palette(self) -> Palette:
        """Return the colours of all markers, as far as P0's is known."""
        colour, known = self.colour, self._palette
        if known is None or known[0] is not colour:
            hues = self._config.hues
            found = (
                Palette.nothing(len(hues))
                if colour is None
                else Palette.of(colour, hues, self._config.marker_hue_tolerance)
            )
            self._palette = known = (colour, found)
        return known[1]

    @property
    def sentences(self) -> tuple[str, ...]:
        """What was found out against expectation."""
        waits = self.proven and not self.certain and self._judged > 2.0 * math.tau
        doubt = waits * "which of the bands is P0 is ambiguous: more than one explains all of them"
        return tuple(filter(None, (self._remark, self.zero.remark, doubt)))

    def _sample(self, frame: ByteArray, setup: Setup, angle: float) -> None:
        """Learn the colour from P0 where the encoder places it."""
        if self._settled:
            return
        if abs(angle) > BAND_REACH:
            self._refuse(
                f"the run begins at {angle:.2f} rad, more than {BAND_REACH} rad behind P0's start: "
                "P0 is sought as it passes"
            )
            return
        try:
            self.colour = sample_colour(frame, self._config, setup, angle)
        except ColourRefusedError as refusal:
            why = colourless(frame, self._config)
            self._refuse(why or str(refusal))
            self._settled |= why.startswith("the picture has no colour")
        else:
            self.refusal, self.certain = "", True

    def _refuse(self, sentence: str) -> None:
        """Keep the first reason, of which later ones are but consequences."""
        if not self.refusal or self.refusal == "no frame with P0 yet":
            self.refusal = sentence

    def _look(self, frame: ByteArray, setup: Setup, angle: float, guide: float) -> bool:
        self._search.add(frame, setup, angle)
        found = self._search.first
        if found is not None:
            self._followed = self.proven = True
            return self._found(found, frame, setup, angle, guide)
        if self.colour is None or not self._search.moving or self._doubts.leaps(angle):
            doubt = self._doubts.add(frame, setup, angle)
            if doubt:
                return self._withdraw(doubt)
        # The doubts about a P0 that was sampled end after two turns.
        far = abs(angle - self._begun) > 2.0 * math.tau
        self.proven = self.colour is not None and far
        return False

    @property
    def _ambiguous(self) -> bool:
        """Whether P0 may be another band yet; once all have landed nothing new is seen."""
        last = math.tau + (self._config.marker_count + 1) * self._config.expected_gap
        return not self.certain and not abs(self._looked - self._begun) > last

    def _identify(
        self, frame: ByteArray, setup: Setup, angle: float, guide: float, state: TrackerState
    ) -> bool:
        """Find out which of the bands is P0 where the run did not begin with it.

        Return whether what was taken for P0 so far, or for markers, is something else.
        """
        # The live window shows bands for 0.46 rad at least: the rate of frames leaves enough looks.
        if abs(angle - self._scanned) < 2.0 * LOOK_STEP:
            return False
        self._scanned = angle
        self._all.add(frame, setup, angle)
        bands, way = self._all.proven, abs(angle - self._begun)
        if way < max(math.tau + setup.usable_azimuth, self._judged / USUAL):
            return False
        self._judged = way
        if not bands:
            # Of a colour that was configured none of that hue may be seen.
            self.certain = self._followed and way > 2.0 * math.tau
            return False
        found = identified(
            bands,
            self._config,
            self._paths,
            lambda band: self._origin_of(band, angle, guide),
            (self._begun, self._set),
            abs(setup.camera.x),
        )
        if found is None:
            return False
        if self.proven and found.agrees(state.shift - self.origin, state.marks):
            self.certain = self._misplaced.done = True
            return False
        self._identified, self.zero = found, CameraZero(self._config, self._camera)
        self.origin, self._remark = self._set, ""
        self._followed = self.proven = True
        self._found(found.first, frame, setup, angle, guide)
        self.certain = self.proven and self.colour is not None
        self._misplaced.done |= self.certain
        return True

    def _origin_of(self, band: MovingBand, angle: float, guide: float) -> float:
        """Return what the encoder reads where a band has landed if that is P0 [rad]."""
        off = math.remainder(band.offset + self._set, math.tau)
        if abs(off) < BAND_REACH:
            return self._set - off
        # The guide gives the whole turns: an encoder that is not zeroed does not count them.
        place, advance, turns = angle + band.offset, self._config.advance_per_radian, 0
        if math.isfinite(guide) and advance > 0.0:
            turns = max(round((guide / advance - place) / math.tau), math.ceil(-place / math.tau))
        return -band.offset - math.tau * turns

    def begin(self, state: TrackerState) -> None:
        """Take P0, and the markers that were found with it, as known in a fresh state."""
        found, marks = self._identified, state.marks
        marks.height[0] = self.height
        if found is None or not self.certain or self.colour is None:
            return
        sure, run = found.numbers >= 0, state.run
        numbers = found.numbers[sure]
        run.guide.offset, run.guide.since = found.offset, self._looked - self.origin
        marks.found[numbers] = self._looked - self.origin
        run.shift = math.remainder(found.first.offset + self.origin, math.tau)
        marks.known[numbers], marks.area[numbers] = True, 1.0
        marks.bias_height[numbers] = BIAS**2
        marks.theta[numbers], marks.height[numbers] = (
            found.theta[sure],
            found.first.z + found.z[sure],
        )
        for name in ("recent", "reference"):
            getattr(marks, name)[numbers] = marks.theta[numbers]
        # What they are measured to counts from the first frame on.
        marks.doubt_theta[numbers[1:]] = SAME_ANGLE**2
        marks.doubt_height[numbers[1:]] = LAY_SIGMA**2

    def _find_elsewhere(self, frame: ByteArray, setup: Setup, angle: float, guide: float) -> bool:
        if self._followed and not self.certain:
            self._misplaced.done = not self._ambiguous
            return False
        followed = -self.origin if self._followed else math.nan
        doubt = self._misplaced.add(
            frame, setup, angle, guide, followed=followed, colour=self.colour
        )
        # What moves where P0 passes may prove itself yet.
        waits = self._search.moving and not self.proven
        return bool(doubt) and not waits and self._withdraw(doubt)

    def _withdraw(self, doubt: str) -> bool:
        """Follow nothing any more, and look for nothing."""
        self._settled = self.proven = self.certain = self._misplaced.done = True
        self.colour, self.refusal = None, doubt
        return True

    def _found(
        self, band: MovingBand, frame: ByteArray, setup: Setup, angle: float, guide: float
    ) -> bool:
        """Take P0 for what it is; return whether markers were counted from elsewhere."""
        if abs(band.z) > SEARCH_REACH:
            return self._withdraw(beside_its_place(band.z, setup))
        off = math.remainder(band.offset + self.origin, math.tau)
        height, explains = 0.0, 0.0
        if BAND_REACH <= abs(off) <= 0.5 * math.pi:
            if band.arc < 2.0 * PROOF_ADVANCE:
                # More of its way tells a wrong zero from a wrong height.
                self._followed = self.proven = False
                return False
            height, explains = band.height(setup, self.origin)
        wrong = f"the camera's height is wrong by {height / MILLIMETRE:+.0f} mm"
        if explains > 1.0:
            self._remark = (
                f"the encoder reads {self.origin - off:.3f} rad where P0 lands, or {wrong}, which "
                "explains P0's path better: set camera_tilt or camera_position, or start_angle"
            )
            # What is seen in the first turn, and until it has passed, may decide otherwise.
            passed = abs(angle - band.last) > BAND_REACH
            if passed and abs(angle - self._begun) > math.tau:
                return self._withdraw(beside_its_place(height, setup, "in height", "x"))
            self._followed = self.proven = False
            return False
        known = self.colour is not None
        if not known:
            samples = np.concatenate(band.samples)
            try:
                self.colour = ColourModel.from_samples(samples, frame.reshape(-1, 3)[::7])
            except ColourRefusedError as refusal:
                self.refusal, self._followed, self.proven = str(refusal), False, False
                return False
            self.refusal = ""
        self.height = band.z
        if abs(off) < BAND_REACH:
            return False
        self.origin = self._origin_of(band, angle, guide)
        self._remark = f"the encoder reads {self.origin:.3f} rad where P0 lands: that is taken off"
        if height:
            self._remark += f", unless {wrong}: set start_angle, or camera_tilt and camera_position"
        return True
