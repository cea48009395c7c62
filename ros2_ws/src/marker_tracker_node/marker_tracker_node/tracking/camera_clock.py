"""The camera's clock against the encoder's: measured from bands that turn; what follows from it.

A band n that is seen at azimuth A_n in a frame stamped s obeys

    A_n = Theta(s - d) + a_n,

Theta the encoder's angle, d the offset and a_n a constant of the band. Where the speed changes, d
and a_n separate: over standing and a ramp, the residual of the reading at the stamp is
a_n - omega d. A wrong number of camera, cylinder or encoder makes bands move by a share s too far,
which over a ramp looks like an offset: it is an unknown beside d. Of a grid of offsets one part
must explain the bands better than the rest, else d is unobservable; from there least squares over
all bands, robust against outliers, gives d.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from marker_tracker_node.arrays import FloatArray
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.encoder_history import (
    HALF_SPAN,
    INTERPOLATED,
    ROWS,
    EncoderHistory,
)
from marker_tracker_node.tracking.estimator.fit import LEAST_INFORMATION, SURE
from marker_tracker_node.tracking.estimator.numbers import CLOCK, FOCAL, NUMBERS, TIMES
from marker_tracker_node.tracking.frame.laid_path import (
    BAND_REACH,
    LOOK_STEP,
    PROOF_ADVANCE,
)
from marker_tracker_node.tracking.frame.run_means import ENCODER_TRUST, MEMORY, REFERENCE_FRAMES
from winding_core.units import MILLISECOND

# One azimuth errs by so much, and by so much together with all others at its speed [rad].
AZIMUTH_SIGMA, SYSTEMATIC = 1.0e-3, 2.5e-4
# Of weights that fall with the misfit, which change little after these.
STEPS = 4
# Frames from one estimate to the next; a known one waits for as many of those.
REFINED_EVERY = 6
# An estimate is replaced by a worse one only as far as clocks may have drifted since [s/s].
DRIFT = NUMBERS[TIMES].doubt
LOCKED = NUMBERS[CLOCK].doubt
# By how much bands may move too far, one standard deviation: focal length and cylinder.
MOTION_SIGMA = NUMBERS[FOCAL].doubt
# A length may be wrong by this share because of the clock.
LENGTH_SHARE = 0.002


@dataclass(frozen=True, kw_only=True)
class ClockEstimate:
    """The camera's clock against the encoder's.

    Attributes:
        shift: Azimuth of P0 less the cylinder's angle at the corrected stamp [rad]; nan before
            P0 was seen.
    """

    offset: float = 0.0  # How far the camera's stamps are ahead [s]
    error: float = math.inf  # One standard deviation [s]; infinity while the offset is unobservable
    shift: float = math.nan

    @property
    def known(self) -> bool:
        """Whether the offset is known well enough to be applied."""
        return self.error < LOCKED


class ClockOffset:
    """Refines the offset with every band that is seen.

    Memory does not grow: the last sightings of each band are kept. A later estimate that knows much
    less, after a long time at one speed for instance, does not replace an earlier one.

    Attributes:
        estimate: The offset so far.
    """

    def __init__(self, history: EncoderHistory, bands: int, limit: float) -> None:
        """Start without sightings of some bands, P0 first; offsets up to a limit [s] are found."""
        self.estimate = ClockEstimate()
        self._history = history
        # What is beyond is distinguished from what is at the limit.
        steps = math.ceil((limit + ClockSettings.limit) / INTERPOLATED)
        self._offsets = INTERPOLATED * np.arange(-steps, steps + 1)
        self._t, self._azimuth, self._weight = np.zeros((3, bands, ROWS))
        # The encoder where the sightings were by each offset; nan before it has come so far.
        self._angle = np.full((bands, ROWS, self._offsets.size), np.nan)
        self._place = np.zeros(bands, dtype=int)
        self._frames = 0
        self._found_at = -math.inf

    def add(self, t: float, azimuths: FloatArray) -> None:
        """Take azimuths of bands [rad] in a frame stamped t [s], nan where not seen, (bands,)."""
        if not len(self._history):
            return
        for n in np.flatnonzero(np.isfinite(azimuths)):
            self._store(int(n), t, float(azimuths[n]))
        self._frames += 1
        if self._frames % REFINED_EVERY ** (1 + self.estimate.known) == 0:
            self._refine()

    def _store(self, n: int, t: float, azimuth: float) -> None:
        place, last = self._place[n], self._place[n] - 1
        turned, passed = abs(azimuth - self._azimuth[n, last]), t - self._t[n, last]
        # One that moved by less, and aged by less than a speed is taken over, shows the same.
        if self._weight[n, last] and turned < 2.0 * LOOK_STEP and passed < HALF_SPAN:
            return
        self._t[n, place], self._azimuth[n, place] = t, azimuth
        # A pixel covers the more of an azimuth the less that faces the camera.
        self._weight[n, place] = max(math.cos(azimuth), 0.0) ** 2
        self._angle[n, place] = np.nan
        self._place[n] = (place + 1) % ROWS

    def _refine(self) -> None:
        """Fit the offset to everything that is kept."""
        instants = self._t[:, :, None] - self._offsets
        new = np.isnan(self._angle) & (self._weight > 0.0)[:, :, None]
        new &= (instants >= self._history.first) & (instants <= self._history.newest)
        self._angle[new] = self._history.angles(instants[new])
        old, now = self.estimate, self._history.newest
        found = self._solve(old.offset) if old.known else self._search()
        if old.known and found.error > min(old.error + DRIFT * (now - self._found_at), LOCKED):
            found = replace(old, shift=old.shift if math.isnan(found.shift) else found.shift)
        else:
            self._found_at = now
        self.estimate = found

    def _search(self) -> ClockEstimate:
        """Return the offset, if but one part of the grid explains the sightings."""
        weight = np.where(np.isnan(self._angle), 0.0, self._weight[:, :, None])
        residual = np.where(weight > 0.0, self._azimuth[:, :, None] - self._angle, 0.0)
        count, robust = weight.sum(axis=(0, 1)), weight
        for _ in range(STEPS):
            mean = (robust * residual).sum(axis=1) / np.maximum(
                robust.sum(axis=1), LEAST_INFORMATION
            )
            square = ((residual - mean[:, None]) / (SURE * AZIMUTH_SIGMA)) ** 2
            robust = weight / (1.0 + square)
        # An offset with which most sightings lie outside of the encoder's readings is none.
        usable = np.flatnonzero(2.0 * count > count.max())
        if not usable.size:
            return ClockEstimate()
        cost = SURE**2 * (weight * np.log1p(square)).sum(axis=(0, 1))[usable] / count[usable]
        as_well = usable[cost < cost.min() + 1.0]
        start = float(self._offsets[as_well[np.argmin(np.abs(self._offsets[as_well]))]])
        found = self._solve(start)
        if as_well[0] > usable[0] and as_well[-1] < usable[-1] and np.ptp(as_well) < as_well.size:
            return found
        return replace(found, offset=start, error=math.inf)

    def _solve(self, offset: float) -> ClockEstimate:
        """Return the offset [s] of least squares, about one that is nearly right."""
        error, robust = math.inf, self._weight
        for _ in range(STEPS):
            place = max((offset - self._offsets[0]) / INTERPOLATED, 0.0)
            low = min(int(place), self._offsets.size - 2)
            before, after = np.moveaxis(self._angle[:, :, low : low + 2], 2, 0)
            seen = np.isfinite(before + after)
            speed = np.where(seen, before - after, 0.0) / INTERPOLATED
            angle = np.where(seen, before, 0.0) - INTERPOLATED * min(place - low, 1.0) * speed
            robust = np.where(seen, robust, 0.0)
            # What is left, and how it goes with offset and share, of each band about its mean.
            rows = np.array([np.where(seen, self._azimuth - angle, 0.0), -speed, angle])
            mean = (robust * rows).sum(axis=2) / np.maximum(robust.sum(axis=1), LEAST_INFORMATION)
            left, *columns = np.where(seen, rows - mean[:, :, None], 0.0)
            normal = np.einsum("ank,bnk,nk->ab", columns, columns, robust)
            normal[1, 1] += (AZIMUTH_SIGMA / MOTION_SIGMA) ** 2
            information = float(normal[0, 0] - normal[0, 1] ** 2 / normal[1, 1])
            if information < LEAST_INFORMATION:
                break
            step = np.linalg.solve(normal, np.einsum("ank,nk,nk->a", columns, left, robust))
            offset += float(step[0])
            left -= np.einsum("a,ank->nk", step, columns)
            count, square = float(robust.sum()), float((robust * left * left).sum())
            error = math.sqrt(
                (max(square / count, AZIMUTH_SIGMA**2) + count * SYSTEMATIC**2) / information
            )
            scatter = max(1.4826 * float(np.median(np.abs(left[seen]))), AZIMUTH_SIGMA)
            robust = self._weight / (1.0 + (left / (SURE * scatter)) ** 2)
        if abs(offset) >= self._offsets[-1]:
            offset, error = 0.0, math.inf
        shift = float(mean[0, 0]) if seen[0].any() else math.nan
        return ClockEstimate(offset=offset, error=error, shift=shift)


@dataclass(frozen=True, kw_only=True)
class ClockSettings:
    """What to do about the camera's clock."""

    correct: bool = False  # Whether the measured offset is applied to the frames that follow
    limit: float = 0.25  # Largest offset with which frames are used [s]

    def __post_init__(self) -> None:
        if not 0.0 < self.limit <= 2.0:
            raise ValueError(f"camera_clock_limit must lie in 0 to 2 s, got {self.limit}")


class CameraClock:
    """The offset of a run's camera and what follows from it.

    A wound angle that rests on the encoder is wrong by offset x (speed - speed at which P0 was
    seen): nothing at the speed of P0, most behind the ramp. One of a frame with P0 is right.

    Attributes:
        settings: What to do about it.
        doubt: One standard deviation of wound angles for the offset, as far as it is not corrected
            [rad], shape (bands,); infinity where it is unobservable and would matter.
        withheld: Whether markers of the last frame were withheld for it.
        applied: Whether the offset is corrected by now.
    """

    def __init__(
        self, settings: ClockSettings, config: TrackerConfig, history: EncoderHistory
    ) -> None:
        """Start with nothing known."""
        self.settings = settings
        self.withheld = False
        self.applied = False
        self.doubt = np.zeros(config.marker_count + 1)
        self._history = history
        self._offset = ClockOffset(history, config.marker_count + 1, settings.limit)
        self._tolerance = max(LENGTH_SHARE * config.expected_gap, SURE * AZIMUTH_SIGMA)
        self._gap = config.expected_gap
        self._fastest = 0.0
        # Mean speed at which the tracker's shift was measured, and its weight in frames.
        self._usual = 0.0
        self._weight = 0.0
        # Of each run mean: the share of its frames without P0, their speed [rad/s] times that, and
        # the weight of all.
        self._apart, self._speeds, self._weights = np.zeros((3, config.marker_count + 1))
        self._strayed = 0.0
        # Frames since P0 was seen, the lap that passes, and whether it has shown P0.
        self._missed, self._lap, self._shown = 0, 0, False
        # Azimuth of P0 at encoder angle zero [rad] where it was found beside its place; else nan.
        self._astray = math.nan

    @property
    def estimate(self) -> ClockEstimate:
        """The offset so far."""
        return self._offset.estimate

    def lead(self, t: float, angle: float, shift: float) -> float:
        """Return how much further than by reading and shift P0 stands in a frame [rad].

        It is stamped t [s], and paired with that reading [rad]; the shift is that of a `Run` [rad].
        """
        # Every second frame without P0 asks the encoder alone, should the estimate be wrong.
        if not math.isfinite(self.estimate.shift) or self._missed % 2:
            return 0.0
        place = self._read(t) + self._zero
        lap = round(place / math.tau)
        if lap != self._lap:
            self._lap, self._shown = lap, False
        return place - angle - shift

    @property
    def beside(self) -> float:
        """How far beside its place P0 is sought, in a lap that has not shown it [rad].

        An encoder or times that are wrong by 7 % have it there.
        """
        return BAND_REACH if self._missed and not self._shown else 0.0

    def take(self, t: float, azimuths: FloatArray) -> None:
        """Take the azimuths [rad] that were seen in a frame that had a reading, stamped t [s].

        They are nan where a band was not seen, shape (markers,).
        """
        self._offset.add(t, azimuths)
        estimate = self.estimate
        speed = self._history.speed(t - estimate.offset)
        self.applied = self.applied or (self.settings.correct and estimate.known)
        self._fastest = max(self._fastest, abs(speed))
        seen = np.isfinite(azimuths)
        if seen[0]:
            self._weight = min(self._weight + 1.0, REFERENCE_FRAMES)
            self._usual += (speed - self._usual) / self._weight
            if not self._shown:
                found = float(azimuths[0]) - self._read(t)
                near = not abs(found - estimate.shift) > PROOF_ADVANCE
                self._astray = math.nan if near else found
            self._missed, self._shown = 0, True
        else:
            self._missed += 1
        apart, trust = (0.0, 1.0) if seen[0] else (1.0, ENCODER_TRUST)
        self._weights[seen] = np.minimum(self._weights[seen] + trust, MEMORY)
        part = trust / np.maximum(self._weights[seen], trust)
        self._apart[seen] += part * (apart - self._apart[seen])
        self._speeds[seen] += part * (apart * speed - self._speeds[seen])
        usual = self._usual if self._weight else speed
        means = self._speeds - self._apart * usual
        rates = np.abs(np.where(seen, apart * (speed - usual), means))
        error = min(estimate.error, self.settings.limit)
        self.doubt = math.hypot(error, 0.0 if self.applied else estimate.offset) * rates
        if not estimate.known:
            # Half of what lengths may be wrong by may stay unknown.
            self.doubt[self.doubt > 0.5 * self._tolerance] = math.inf

    def stray(self, lead: float) -> None:
        """Take note of how far a stamp lies ahead of all readings, negative for behind [s]."""
        self._strayed = lead

    @property
    def refusal(self) -> str:
        """Why frames cannot be used; empty while they can."""
        limit = f"limit camera_clock_limit {self.settings.limit / MILLISECOND:.0f} ms"
        return f"{_ahead(self._strayed)}, {limit}: frames are refused" if self._strayed else ""

    @property
    def warning(self) -> str:
        """What is wrong with lengths because of the clock; empty while nothing is."""
        estimate = self.estimate
        wrong = (abs(estimate.offset) + 2.0 * estimate.error) * self._fastest
        significant = abs(estimate.offset) > SURE * estimate.error
        if wrong > self._tolerance and significant and not self.settings.correct:
            share = f"{100.0 * wrong / self._gap:.1f} %, limit {100.0 * LENGTH_SHARE:.1f} %"
            return (
                f"{_ahead(estimate.offset)}: lengths may be wrong by {share}; mend its stamps or "
                "set camera_clock_correction"
            )
        if self.withheld:
            return "the offset of the camera's clock is not known yet: markers are withheld"
        return ""

    def values(self) -> dict[str, str]:
        """Return the offset and its standard error [ms] as text; nan while unknown."""
        estimate = self.estimate
        known = math.isfinite(estimate.error)
        numbers = (estimate.offset, estimate.error) if known else (math.nan, math.nan)
        offset, error = (f"{number / MILLISECOND:.2f}" for number in numbers)
        return {"camera_clock_offset_ms": offset, "camera_clock_offset_error_ms": error}

    @property
    def _zero(self) -> float:
        return self._astray if math.isfinite(self._astray) else self.estimate.shift

    def _read(self, t: float) -> float:
        """Return the encoder's angle when a frame stamped t [s] was exposed [rad]."""
        return float(self._history.angles(np.array([t - self.estimate.offset]))[0])


def _ahead(offset: float) -> str:
    way = "ahead of" if offset > 0.0 else "behind"
    return f"the camera's clock is {abs(offset) / MILLISECOND:.1f} ms {way} the encoder's"
