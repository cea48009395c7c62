"""Which configured number contradicts the pictures: a run has more measurements than unknowns.

P0 comes back once a turn, which tests the encoder's scale and the frames' times; how fast bands
move over the picture and how large they are tests cylinder, cable and camera; where bands lie
tests their spacing. One number at a time is thought to be wrong.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.tracking.checks.contradiction import Contradiction, Evidence, size_in_words
from marker_tracker_node.tracking.checks.geometry import (
    CHANCE,
    LEAST_MOTION,
    SIGMA,
    USUAL,
    signatures,
    sized_wrongly,
    wrong_geometry,
)
from marker_tracker_node.tracking.checks.passings import (
    TURN,
    Passing,
    motion_of,
    passings_of,
    stretched,
    turns_left,
)
from marker_tracker_node.tracking.evidence import RunEvidence, SightingLog
from marker_tracker_node.tracking.state import Setup, TrackerState

FloatArray = NDArray[np.float64]

# So many frames must have had a marker in sight that should have come back.
_LEAST_AWAITED = 4
# A marker that comes back in fewer frames than this share has not come back.
_RETURNED = 0.5
# Markers are found in more frames than this share while nothing is wrong.
_USUALLY_FOUND = 0.8
# A hypothesis whose residuals are so many times smaller is the better one.
_BETTER = 1.15
# What is left of two hypotheses is the same within a fifth of a frame's deviation [rad].
_SAME = 2.0e-4
# Grey levels of a picture that fell to less than this share of the beginning's.
_DARKER = 0.75
_LEAST_TURN_SHARE = 0.0015
# Gaps between markers relative to expected ones: no modulus is set so wrongly.
_GAPS = (0.72, 1.5)


class RunChecks:
    """The contradictions of a run, judged anew once a lap of any marker."""

    def __init__(self) -> None:
        self._judged: tuple[int, tuple[Contradiction, ...]] = (0, ())

    def judged(
        self, run: RunEvidence, setup: Setup, state: TrackerState
    ) -> tuple[Contradiction, ...]:
        """Return which configured numbers the pictures speak against.

        Args:
            run: What was kept of it.
            setup: Machine and camera.
            state: Of the tracker.
        """
        laps = len(run.log.laps)
        if self._judged[0] != laps:
            marks = state.marks
            known = np.flatnonzero(marks.known)
            apart = np.diff(marks.theta[known]) / (np.diff(known) * setup.expected_gap)
            evidence = Evidence(
                log=run.log,
                area=marks.area[known],
                effects=signatures(setup.camera, setup.body),
                gaps=dict(zip(known[:-1].tolist(), apart.tolist(), strict=True)),
                known=tuple(known[known > 0].tolist()),
                between=run.unnumbered.found,
            )
            self._judged = laps, contradictions(evidence)
        return self._judged[1]


def contradictions(evidence: Evidence) -> tuple[Contradiction, ...]:
    """Return which configured numbers the evidence speaks against; empty for a consistent run."""
    passings = passings_of(evidence.log)
    turning = _of_light(evidence) or _of_turns(evidence, passings)
    if turning is not None:
        # Where bands lie shows nothing while their turns, or the picture, are in doubt.
        return (turning,)
    found = (wrong_geometry(evidence, passings) or _of_colour(evidence.log), _of_spacing(evidence))
    return tuple(item for item in found if item is not None)


def _of_turns(evidence: Evidence, passings: list[Passing]) -> Contradiction | None:
    """Judge scale and times by when markers come back, or by how bands move that do not."""
    log = evidence.log
    ahead = {(item.marker, item.lap): item.ahead for item in passings}
    pairs = np.array(
        [
            (place, ahead[marker, lap + 1])
            for (marker, lap), place in ahead.items()
            # A band that was taken for another lap's shows nothing.
            if abs(ahead.get((marker, lap + 1), place) - place - TURN) < 0.5 * TURN
        ]
    ).reshape(-1, 2)
    turns = np.diff(pairs, axis=1)[:, 0] / TURN - 1.0
    motion = motion_of(passings)
    if turns.size and _returned(log) >= _RETURNED:
        share = float(np.median(turns))
        sigma = float(np.std(turns) / math.sqrt(turns.size)) if turns.size > 1 else 5.0e-4
        if abs(share) <= max(_LEAST_TURN_SHARE, 4.0 * sigma):
            return None
        how = f"P0 comes back after {1.0 + share:.4f} turns of the encoder"
    else:
        if motion is None or _returned(log) >= _RETURNED or not _awaited(log):
            return None
        if sized_wrongly(evidence, motion):
            return None
        share = math.exp(USUAL.motion) / motion.value - 1.0
        sigma = math.hypot(SIGMA.motion, motion.sigma)
        # Colour that is lost is lost for markers that land, too.
        if abs(share) <= max(LEAST_MOTION, CHANCE * motion.sigma) and not _landed_since(log):
            return None
        how = (
            f"the bands move {1.0 / (1.0 + share):.3f} times as far as the encoder reports and do "
            "not come back where it places them"
        )
    if turns.size:
        by_angle, by_time = turns_left(pairs, log.motion, share)
        by_times = share
    else:
        assert motion is not None
        drift = stretched(passings, log.motion, math.exp(USUAL.motion))
        by_angle, by_time, by_times = motion.rest, drift.rest, drift.value
    number, what = "encoder_or_times", "the encoder's angles or the times of the frames are"
    least = _SAME if turns.size else 0.0
    if by_angle > _BETTER * by_time + least:
        number, what, share = "frame_times", "the times of the frames are", by_times
    elif by_time > _BETTER * by_angle + least:
        number, what = "encoder_scale", "the encoder's angles are"
    return Contradiction(
        number=number,
        share=share,
        sigma=sigma,
        sentence=f"{what} {size_in_words(share)}: {how}",
    )


def _of_light(evidence: Evidence) -> Contradiction | None:
    """Judge light that fades, before its effect on the bands is taken for something else."""
    laps = _whole_laps(evidence.log)
    if not laps:
        return None
    first, last = (evidence.log.laps[0, lap] for lap in (laps[0], laps[-1]))
    before, now = first.light / first.frames, last.light / last.frames
    found, areas = _found(evidence.log, laps[-1]), evidence.area[evidence.area > 0.0]
    smaller = areas.size > 0 and float(np.median(np.log(areas))) < USUAL.area - SIGMA.area
    if now >= _DARKER * before or (found >= _USUALLY_FOUND and not smaller):
        return None
    return Contradiction(
        number="light",
        share=now / before - 1.0,
        sigma=math.nan,
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
    first, found = log.laps[0, laps[0]], _found(log, laps[-1])
    if found >= _RETURNED or first.measured < _RETURNED * first.frames:
        return None
    return Contradiction(
        number="marker_colour",
        share=math.nan,
        sigma=math.nan,
        sentence=(
            f"markers are found in {found:.0%} of the frames that have them in sight, and the "
            "light is as it was: their colour has changed, or something covers them"
        ),
    )


def _whole_laps(log: SightingLog) -> list[int]:
    """Return the laps of P0 but the newest, which may be on its way; none unless two are left."""
    laps = sorted({lap for marker, lap in log.laps if marker == 0})[:-1]
    return laps if len(laps) > 1 else []


def _found(log: SightingLog, lap: int) -> float:
    """Return the share of frames that found a marker in a lap of P0."""
    late = [one for (_, number), one in log.laps.items() if number == lap]
    return sum(one.measured for one in late) / max(sum(one.frames for one in late), 1)


def _of_spacing(evidence: Evidence) -> Contradiction | None:
    """Judge the spacing by bands that have no number, numbers without a band, and gaps."""
    if evidence.between:
        pairs = ", ".join(f"P{n}" for n in evidence.between)
        return Contradiction(
            number="marker_spacing",
            share=math.nan,
            sigma=math.nan,
            sentence=f"the marker spacing is set too large: another band lies after {pairs}",
        )
    skipped = math.gcd(*evidence.known) if evidence.known else 1
    if skipped > 1:
        seen = ", ".join(f"P{n}" for n in evidence.known)
        missed = "" if len(evidence.known) > 1 else ", unless markers before it were missed"
        return Contradiction(
            number="marker_spacing",
            share=1.0 / skipped - 1.0,
            sigma=math.nan,
            sentence=(
                f"the marker spacing is set {skipped} times too small: bands are where {seen} are "
                f"expected and none between them{missed}"
            ),
        )
    gaps = list(evidence.gaps.values())
    if not gaps or _GAPS[0] <= float(np.median(gaps)) <= _GAPS[1]:
        return None
    ratio = float(np.median(gaps))
    return Contradiction(
        number="marker_spacing",
        share=1.0 / ratio - 1.0,
        sigma=math.nan,
        sentence=(
            f"the marker spacing is set too {'small' if ratio > 1.0 else 'large'}: bands lie "
            f"{ratio:.2f} times as far apart as it and the cable's stretch give"
        ),
    )


def _later(log: SightingLog) -> list[tuple[int, int]]:
    """Return the laps of markers after the first that each was seen in."""
    first: dict[int, int] = {}
    for marker, lap in sorted(log.laps):
        first.setdefault(marker, lap)
    return [(marker, lap) for marker, lap in log.laps if lap > first[marker]]


def _returned(log: SightingLog) -> float:
    """Return the share of frames that found a marker when it came back."""
    later = [log.laps[key] for key in _later(log)]
    return sum(one.measured for one in later) / max(sum(one.frames for one in later), 1)


def _landed_since(log: SightingLog) -> bool:
    """Return whether a marker was found for the first time after P0 was seen last."""
    rows = log.sightings
    last = rows[rows[:, 0] == 0, 2].max(initial=-math.inf)
    later = rows[rows[:, 0] > 0]
    return any(
        own.shape[0] >= _LEAST_AWAITED and own[:, 2].min() > last
        for own in (later[later[:, 0] == marker] for marker in np.unique(later[:, 0]))
    )


def _awaited(log: SightingLog) -> bool:
    """Return whether any marker should have come back by now."""
    return sum(log.laps[key].frames for key in _later(log)) >= _LEAST_AWAITED
