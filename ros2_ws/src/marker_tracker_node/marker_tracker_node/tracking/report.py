"""What a tracker reports: counts, what the run contradicts, and whether it is healthy.

Where bands appear, and how large they are, tests encoder, times, camera, cylinder and cable
(`estimator`); whether they are found at all tests light and colour; how far apart they lie tests
their spacing, and where along the cylinder the guide's readings.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from marker_tracker_node.arrays import FloatArray, IndexArray
from marker_tracker_node.detection.band import LEAST_APART
from marker_tracker_node.tracking.estimator.contradictions import Contradiction, explained
from marker_tracker_node.tracking.estimator.correction import Correction
from marker_tracker_node.tracking.estimator.fit import LEAST_ROWS, SURE, USUAL
from marker_tracker_node.tracking.estimator.problem import AREA_SIGMA, MARKER, Seen
from marker_tracker_node.tracking.estimator.verdict import AS_WELL, LEAST_ALONE, LEFT_ALONE
from marker_tracker_node.tracking.frame.laid_path import (
    FARTHEST,
    GAP_SIGMA,
    LAY_SIGMA,
    MOST_SCALE,
    USUAL_SCALE,
    beside_path,
    corrected_height,
    laid_cable,
    lay_share,
    lift_at,
    overdue,
)
from marker_tracker_node.tracking.sighting_log import Lap, SightingLog
from marker_tracker_node.tracking.state import BY_READINGS, IMPOSSIBLE, TRIED, Setup, TrackerState
from winding_core.units import MILLIMETRE

# It is judged anew with so many times as many sightings.
_MORE = 1.2
# Single frames that come twice or late spoil nothing: share of frames that may be refused.
_MOST_REFUSED = 0.01
# Numbers that say when a band comes back.
_TURNING = frozenset({"encoder_scale", "frame_times"})


class FrameFault(Enum):
    """Why a frame was not used."""

    EMPTY = "empty frame"
    WRONG_SIZE = "frame of another size than the camera's"
    WRONG_ENCODING = "frame that is not 8-bit blue-green-red"
    OUT_OF_ORDER = "frame older than the last"
    DUPLICATE = "frame with the stamp of the last"
    OTHER_CLOCK = "frame of a camera whose clock is too far from the encoder's"
    NOT_A_TIME = "frame without a finite time"


@dataclass(frozen=True, kw_only=True)
class TrackerReport:
    """Counts since the start and the situation in the last frame.

    Attributes:
        colour_separation: Share of background pixels that the colour model rejects; nan if
            unknown.
    """

    frames: int  # Frames used
    rejected: dict[FrameFault, int]  # Frames refused, by reason
    known: int  # Markers that are known, P0 among them
    measured: int  # Markers measured in the last frame
    slipped: tuple[int, ...]  # Numbers of the markers that have slipped
    encoder_lost: bool  # Whether the last frame came without an encoder reading
    encoder_losses: int  # Times that the encoder went missing
    encoder_wraps: int  # Turns that the encoder lost by wrapping
    colour_refusal: str  # Why no colour could be learnt yet; empty when there is one
    remarks: tuple[str, ...]  # What was found at the start against expectation
    colour_separation: float
    contradictions: tuple[Contradiction, ...]  # Configured numbers that the pictures speak against
    missing: tuple[int, ...] = ()  # Numbers of the markers that should have been found long ago
    guide_doubt: str = ""  # What is wrong with the guide's readings; empty if nothing
    crossing: str = ""  # Which markers lie on one another; empty if none
    clock_doubt: str = ""  # What is wrong with the camera's clock; empty if nothing
    judged: bool = True  # Whether the sightings of two markers have been explained

    @property
    def doubts(self) -> tuple[str, ...]:
        """What contradicts the run that is expected, in sentences."""
        refused = sum(self.rejected.values())
        doubts = (
            self.guide_doubt,
            self.crossing,
            *(f"P{n} was not found where it should lie" for n in self.missing),
            *(f"P{n} has slipped" for n in self.slipped),
            "the encoder is silent" if self.encoder_lost else "",
            f"{refused} of {refused + self.frames} frames were refused"
            if refused > _MOST_REFUSED * self.frames
            else "",
        )
        return tuple(filter(None, doubts))

    @property
    def healthy(self) -> bool:
        """Whether nothing is wrong at the moment."""
        wrong = [item for item in self.contradictions if not item.doubted]
        against = (self.colour_refusal, self.clock_doubt, wrong, self.doubts)
        # Nothing rests on what is configured while P0 alone is known.
        return not any(against) and self.known > 0 and (self.judged or self.known == 1)


class RunChecks:
    """What follows from the evidence of a run.

    Attributes:
        contradictions: Configured numbers that the pictures speak against.
        correction: What they correct of those; None if nothing.
    """

    def __init__(self) -> None:
        self.contradictions: tuple[Contradiction, ...] = ()
        self.correction: Correction | None = None
        # How many markers and turns, and sightings, were judged; and markers after a pass.
        self._news, self._rows, self._markers = (0, 0), 0, 0

    def judge(
        self, log: SightingLog, setup: Setup, state: TrackerState, seen: Callable[[], Seen]
    ) -> bool:
        """Judge anew with every marker, turn and a fifth more sightings, and a marker's first pass.

        What is explained is made by `seen`. Return whether it is done.
        """
        laps, rows = log.laps, len(log.sightings)
        news = len(laps), max(map(len, laps.values()), default=0)
        passed = len(laps) != self._markers and log.quiet
        more = rows > _MORE * self._rows
        if passed or more:
            self._markers = len(laps)
        # A marker that comes while numbers are corrected is doubted as that leaves it.
        corrected = self.correction is not None and self.correction.carried
        if self._news == news and not more and (corrected or not passed):
            return False
        self._news, self._rows = news, rows
        lost = _of_light_and_colour(log, state.marks.area)
        if lost is not None and lost.number == "light":
            # Before its effect on the bands is taken for something else.
            self.contradictions = (lost,)
            return False
        wrong, self.correction = explained(seen()) if rows >= LEAST_ROWS else ((), None)
        found: tuple[Contradiction | None, ...] = wrong
        # Where bands lie and which are lost shows nothing while their turns are in doubt.
        if not any(item.names & _TURNING for item in wrong):
            found = (*(wrong or (lost,)), _of_spacing(setup, state), _of_guide(setup, state))
        self.contradictions = tuple(item for item in found if item is not None)
        return True

    def covers(self, log: SightingLog) -> bool:
        """Return whether P0 and another marker were judged, and every one that was seen."""
        every = 1 < self._markers == len(log.laps) and self._rows >= LEAST_ROWS
        return every and bool((log.sightings[:, MARKER] == 0).any())


def _of_light_and_colour(log: SightingLog, area: FloatArray) -> Contradiction | None:
    """Judge light and colour by the markers that are in sight and no longer found.

    The newest lap of P0 may be on its way: what shows is the one before, beside the first.
    """
    laps = sorted(log.laps.get(0, ()))[:-1]
    if len(laps) < 2:
        return None
    first, last = (log.laps[0][lap] for lap in (laps[0], laps[-1]))
    every = [own[laps[-1]] for own in log.laps.values() if laps[-1] in own]
    late = Lap(sum(one.measured for one in every), sum(one.missed for one in every))
    before, now = first.light / first.frames, last.light / last.frames
    areas = area[area > 0.0]
    smaller = areas.size > 0 and float(np.median(np.log(areas))) < -2.0 * AREA_SIGMA
    found = f"markers are found in {late.share:.0%} of the frames that have them in sight"
    # Markers are found in most frames that have them in sight, and pictures keep their grey levels.
    if now < USUAL * before and (late.share < USUAL or smaller):
        return Contradiction(
            number="light",
            share=now / before - 1.0,
            sentence=(
                f"the picture has become darker, from {before:.0f} to {now:.0f} grey levels: "
                f"{found}"
            ),
        )
    # What is missed more often than it is found has not come back.
    if late.measured < late.missed and first.measured >= first.missed:
        return Contradiction(
            number="marker_colour",
            sentence=(
                f"{found}, and the light is as it was: their colour has changed, or something "
                "covers them"
            ),
        )
    return None


def _of_spacing(setup: Setup, state: TrackerState) -> Contradiction | None:
    """Judge the spacing by the numbers of known markers, and by their gaps."""
    marks = state.marks
    known = np.flatnonzero(marks.known)
    numbers = known[known > 0].tolist()
    skipped = math.gcd(*numbers) if numbers else 1
    if skipped > 1:
        seen = ", ".join(f"P{n}" for n in numbers)
        missed = "" if len(numbers) > 1 else ", unless markers before it were missed"
        return Contradiction(
            number="marker_spacing",
            share=1.0 / skipped - 1.0,
            sentence=(
                f"the marker spacing is set {skipped} times too small: bands are where {seen} are "
                f"expected and none between them{missed}"
            ),
        )
    gaps = np.diff(marks.theta[known]) / (np.diff(known) * setup.expected_gap)
    ratio = float(np.median(gaps)) if gaps.size else 1.0
    uneven = float(np.abs(np.log(gaps / ratio)).max(initial=0.0)) > SURE * GAP_SIGMA
    if abs(math.log(ratio)) < SURE * GAP_SIGMA and not uneven:
        return None
    return Contradiction(
        number="marker_spacing",
        share=1.0 / ratio - 1.0,
        sentence=(
            f"the marker spacing is set too {'small' if ratio > 1.0 else 'large'}: bands lie "
            f"{ratio:.2f} times as far apart as it and the cable's stretch give"
            + ", and not evenly: was one missed?"
            * uneven
        ),
        # No modulus is set more wrongly; but a gap that is alone may be that of two markers.
        doubted=1.0 / USUAL_SCALE <= ratio <= USUAL_SCALE and not uneven and gaps.size > 1,
    )


def _of_guide(setup: Setup, state: TrackerState) -> Contradiction | None:
    """Judge zero and scale of the guide's readings by the heights of the markers."""
    known, beside, share = _beside_readings(setup, state)
    if state.run.guide.laid_by != BY_READINGS or known.size < 3:
        return None
    z = state.marks.height[known] - state.marks.height[0]
    shapes = {"guide_offset": share, "guide_scale": z - beside}
    # By how much either one is wrong, and what that leaves of the markers' places.
    sizes = {name: float(beside @ shape / (shape @ shape)) for name, shape in shapes.items()}
    left = {
        name: float(np.square(beside - sizes[name] * shape).sum()) / LAY_SIGMA**2
        for name, shape in shapes.items()
    }
    usual = float(beside @ beside) / LAY_SIGMA**2
    first, second = sorted(left, key=lambda name: left[name])
    if usual - left[first] < LEAST_ALONE or left[first] > LEFT_ALONE * usual:
        return None
    return Contradiction(
        number=first,
        sentence=(
            f"the guide's readings are {-sizes['guide_offset'] / MILLIMETRE:+.1f} mm beside where "
            f"the cable is led, or {1.0 / (1.0 + sizes['guide_scale']):.2f} times as large"
        ),
        alternatives=(second,) if left[second] < left[first] + AS_WELL else (),
        doubted=1.0 / USUAL_SCALE <= 1.0 + sizes["guide_scale"] <= USUAL_SCALE,
    )


def _beside_readings(
    setup: Setup, state: TrackerState
) -> tuple[IndexArray, FloatArray, FloatArray]:
    """Return the known markers' numbers, how far they lie beside the path of the guide's readings.

    That is without any offset of the guide [m], and the share of it that each lies off, (k,); all
    are empty while P0 is not known.
    """
    marks, run = state.marks, state.run
    known = np.flatnonzero(marks.known) if marks.known[0] else np.empty(0, dtype=np.int64)
    beside = [
        beside_path(setup, run.guide, marks, state.paths, run.path_filled, 0, int(n)) for n in known
    ]
    share = [lay_share(setup, theta) for theta in marks.theta[known]]
    return known, np.array(beside), np.array(share)


def guide_doubt(setup: Setup, state: TrackerState) -> str:
    """Return what is wrong with the guide's readings in the last frame, empty if nothing."""
    guide = state.run.guide
    if guide.laid_by == BY_READINGS:
        _, beside, share = _beside_readings(setup, state)
        off = float(np.abs(beside - guide.offset * share).max(initial=0.0))
        if not (math.isfinite(guide.zero) and off > FARTHEST * LAY_SIGMA):
            return ""
        return (
            f"a marker lies {off / MILLIMETRE:.0f} mm beside where the guide has led the cable: "
            "are markers confused?"
        )
    expected = setup.advance_per_radian * guide.turned
    scale = guide.travel / expected if expected else math.inf
    if abs(scale) > MOST_SCALE:
        why = "are they millimetres instead of metres?"
        if scale < 0.0:
            why = "are they millimetres instead of metres, and is their sign reversed?"
    else:
        why = "is their sign reversed?" if scale < 0.0 else "is their scale right?"
    how = "no marker was found where they lead" if guide.laid_by == TRIED else "the cable lies so"
    if guide.laid_by == IMPOSSIBLE:
        how = "no guide moves so far"
    return (
        f"the guide's readings move {scale:.3g} times as far as the commanded feed, {why} "
        f"The commanded feed is used instead: {how}"
    )


def crossing(setup: Setup, state: TrackerState) -> str:
    """Return which neighbours' bands lie on one another, empty if none.

    Their turns are nearer than cable beside cable can be: one is raised by the other, or the two
    are measured as one. Turns of different layers are expected to.
    """
    marks, cable = state.marks, laid_cable(state.tracks, state.run)
    thick = 2.0 * setup.body.cable_radius
    for below, n in itertools.pairwise(np.flatnonzero(marks.known).tolist()):
        ahead = math.remainder(float(marks.theta[n] - marks.theta[below]), math.tau)
        rise = corrected_height(cable, float(marks.theta[n]) - ahead)[0] - marks.height[below]
        higher = lift_at(cable, float(marks.theta[n])) - lift_at(cable, float(marks.theta[below]))
        facing = abs(ahead) * setup.body.rho < 2.0 * setup.body.half_band
        if facing and abs(rise) < LEAST_APART * thick and higher < setup.body.cable_radius:
            return (
                f"P{n} lies on P{below}: their turns are {abs(rise) / MILLIMETRE:.1f} mm apart, "
                f"the cable is {thick / MILLIMETRE:.1f} mm thick"
            )
    return ""


def missing_markers(setup: Setup, state: TrackerState, *, p0_late: bool) -> tuple[int, ...]:
    """Return the numbers of the markers that should have been found long ago.

    P0 is if it is late and not known, or if it was not measured when it came round again.
    """
    marks, run = state.marks, state.run
    known = np.flatnonzero(marks.known)
    if not (marks.known[0] and marks.weight[0]):
        again = marks.found[0] + math.tau + setup.usable_azimuth
        return (0,) if (run.cylinder.angle > again if marks.known[0] else p0_late) else ()
    last = int(known[-1])
    # Then the next one is due as well, and this one has come past the camera once more.
    due = overdue(setup, marks, last) + math.tau
    late = [n for n in range(last) if not marks.known[n]]
    if last + 1 < marks.known.size and run.cylinder.angle > due:
        late.append(last + 1)
    return tuple(late)
