"""Which configured number contradicts the pictures: a run has more measurements than unknowns.

Where bands appear, and how large they are, tests encoder, times, camera, cylinder and cable
(`estimator`); whether they are found at all tests light and colour; how far apart they lie tests
their spacing.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from marker_tracker_node.arrays import FloatArray
from marker_tracker_node.tracking.checks.lay_check import USUAL_SCALE
from marker_tracker_node.tracking.estimator.contradictions import Contradiction, explained
from marker_tracker_node.tracking.estimator.correction import Correction
from marker_tracker_node.tracking.estimator.fit import LEAST_ROWS, SURE
from marker_tracker_node.tracking.estimator.problem import AREA_SIGMA, Seen
from marker_tracker_node.tracking.estimator.verdict import AS_WELL, LEAST_ALONE, LEFT_ALONE
from marker_tracker_node.tracking.frame.laid_path import LAY_SIGMA, beside_path, lay_share
from marker_tracker_node.tracking.sighting_log import Lap, SightingLog
from marker_tracker_node.tracking.state import BY_READINGS, Setup, TrackerState
from winding_core.units import MILLIMETRE

# It is judged anew with so many times as many sightings.
_MORE = 1.2
# Numbers that say when a band comes back.
_TURNING = frozenset({"encoder_scale", "frame_times"})
# While nothing is wrong markers are found in more frames than this share of those that have them in
# sight, and a picture keeps as much of the beginning's grey levels.
_USUAL = 0.8
# Doubt of gaps by tape measure and stretch, relative: where the cylinder takes up 0.7 of the pull,
# markers of the study's softest cables lie a tenth nearer than its modulus gives.
_GAP_SIGMA = 0.08


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
        light = _of_light(log, state.marks.area)
        if light is not None:
            self.contradictions = (light,)
            return False
        wrong, self.correction = explained(seen()) if rows >= LEAST_ROWS else ((), None)
        self.contradictions = _of_everything(wrong, log, setup, state)
        return True

    def covers(self, log: SightingLog) -> bool:
        """Return whether two markers or more were judged, and every one that was seen."""
        return 1 < self._markers == len(log.laps) and self._rows >= LEAST_ROWS


def _of_everything(
    wrong: tuple[Contradiction, ...], log: SightingLog, setup: Setup, state: TrackerState
) -> tuple[Contradiction, ...]:
    """Return what the bands contradict by their places, and what is left of them unexplained."""
    if any(item.names & _TURNING for item in wrong):
        # Where bands lie and which are lost shows nothing while their turns are in doubt.
        return wrong
    marks = state.marks
    known = np.flatnonzero(marks.known)
    apart = np.diff(marks.theta[known]) / (np.diff(known) * setup.expected_gap)
    spacing = _of_spacing(apart, tuple(known[known > 0].tolist()))
    found = (*(wrong or (_of_colour(log),)), spacing, _of_guide(setup, state))
    return tuple(item for item in found if item is not None)


def _of_light(log: SightingLog, area: FloatArray) -> Contradiction | None:
    """Judge light that fades, before its effect on the bands is taken for something else."""
    laps = _whole_laps(log)
    if not laps:
        return None
    first, last = (log.laps[0][lap] for lap in (laps[0], laps[-1]))
    before, now = first.light / first.frames, last.light / last.frames
    found, areas = _late(log, laps[-1]).share, area[area > 0.0]
    smaller = areas.size > 0 and float(np.median(np.log(areas))) < -2.0 * AREA_SIGMA
    if now >= _USUAL * before or (found >= _USUAL and not smaller):
        return None
    return Contradiction(
        number="light",
        share=now / before - 1.0,
        sentence=(
            f"the picture has become darker, from {before:.0f} to {now:.0f} grey levels: markers "
            f"are found in {found:.0%} of the frames that have them in sight"
        ),
    )


def _of_colour(log: SightingLog) -> Contradiction | None:
    """Judge the markers' colour by those that are in sight and no longer found."""
    laps = _whole_laps(log)
    if not laps:
        return None
    first, late = log.laps[0][laps[0]], _late(log, laps[-1])
    # What is missed more often than it is found has not come back.
    if late.measured >= late.missed or first.measured < first.missed:
        return None
    return Contradiction(
        number="marker_colour",
        sentence=(
            f"markers are found in {late.share:.0%} of the frames that have them in sight, and the "
            "light is as it was: their colour has changed, or something covers them"
        ),
    )


def _whole_laps(log: SightingLog) -> list[int]:
    """Return the laps of P0 but the newest, which may be on its way; none unless two are left."""
    laps = sorted(log.laps.get(0, ()))[:-1]
    return laps if len(laps) > 1 else []


def _late(log: SightingLog, lap: int) -> Lap:
    """Return how often any marker was found in a lap of P0."""
    late = [laps[lap] for laps in log.laps.values() if lap in laps]
    return Lap(sum(one.measured for one in late), sum(one.missed for one in late))


def _of_spacing(gaps: FloatArray, known: tuple[int, ...]) -> Contradiction | None:
    """Judge the spacing by the numbers of known markers, and by their gaps.

    Gaps are wound angles between known neighbours over the expected one.
    """
    skipped = math.gcd(*known) if known else 1
    if skipped > 1:
        seen = ", ".join(f"P{n}" for n in known)
        missed = "" if len(known) > 1 else ", unless markers before it were missed"
        return Contradiction(
            number="marker_spacing",
            share=1.0 / skipped - 1.0,
            sentence=(
                f"the marker spacing is set {skipped} times too small: bands are where {seen} are "
                f"expected and none between them{missed}"
            ),
        )
    ratio = float(np.median(gaps)) if gaps.size else 1.0
    uneven = float(np.abs(np.log(gaps / ratio)).max(initial=0.0)) > SURE * _GAP_SIGMA
    if abs(math.log(ratio)) < SURE * _GAP_SIGMA and not uneven:
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
        # No modulus is set more wrongly.
        doubted=1.0 / USUAL_SCALE <= ratio <= USUAL_SCALE and not uneven,
    )


def _of_guide(setup: Setup, state: TrackerState) -> Contradiction | None:
    """Judge zero and scale of the guide's readings by the heights of the markers."""
    marks, run = state.marks, state.run
    known = np.flatnonzero(marks.known)
    if run.guide.belief != BY_READINGS or known.size < 3 or known[0] > 0:
        return None
    filled, z = run.path_filled, marks.height[known] - marks.height[0]
    beside = np.array(
        [beside_path(setup, run.guide, marks, state.paths, filled, 0, int(n)) for n in known]
    )
    share = np.array([lay_share(setup, theta) for theta in marks.theta[known]])
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
