"""The camera's clock against the encoder's: measured from bands that turn; what follows from it.

A band n that is seen at azimuth A_n in a frame stamped s obeys

    A_n = Theta(s - d) + a_n,

Theta the encoder's angle, d the offset and a_n a constant of the band. Where the speed changes, d
and a_n separate: over standing and a ramp, the residual of the reading at the stamp is
a_n - omega d. A wrong number of camera, cylinder or encoder makes bands move by a share s too far,
which over a ramp looks like an offset: it is an unknown beside d. Least squares over all bands,
robust against outliers, gives d.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.encoder_history import EncoderHistory
from marker_tracker_node.tracking.frame.run_means import SHIFT_SHARE
from winding_core.units import MILLISECOND

FloatArray = NDArray[np.float64]

# Sightings kept of each band, no closer than this in angle or time [rad, s]; a band that stands
# shows the same pixels, with the same bias, and is kept less often [s].
ROWS = 256
SPACING_ANGLE = 4.0e-3
SPACING_TIME, SPACING_REST = 0.02, 0.1
REST_ANGLE = 1.0e-3
# An estimate is replaced by a worse one only as far as clocks may have drifted since [s/s].
DRIFT = 1.0e-4
# Offsets are sought this far beyond the limit [s], on a grid [s], while they are not known so well.
BEYOND = 0.25
GRID = 0.01
LOCKED = 5.0e-3
# One azimuth across the picture errs by so much together with its neighbours [rad].
SYSTEMATIC = 1.0e-3
LEAST_SCATTER = 3.0e-4
OUTLIER = 2.5
STEPS = 4
# The biases of an azimuth grow towards the edge of the cylinder: weight cos^FACING.
FACING = 4
# By how much bands may move too far, one standard deviation: focal length and cylinder are known to
# 0.1 % (`estimator.numbers`). With 0.2 % the first marker of case 4 would be withheld until P0
# returns.
MOTION_SIGMA = 0.001
# Speeds that differ by less show nothing [rad/s].
LEAST_SPAN = 0.01
# A sighting of less weight than this does not count as having been at its speed.
LEAST_WEIGHT, LEAST_TOTAL = 0.2, 1.0e-9
REFINED_EVERY, MORE_SPEEDS = 10, 1.1
# An offset of this size costs as much as so much misfit: without evidence there is none.
PREFERENCE = 1.0e-4
# A length may be wrong by this share because of the clock; the part of it that may stay unknown.
LENGTH_SHARE = 0.002
WITHHELD_PART = 0.5
SIGMAS = 2.0
SURE = 3.0
# Of a marker's wound angle when it is found first [rad].
_FIRST_ERROR = 4.0e-3


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
    less, after a long pause for instance, does not replace an earlier one.

    Attributes:
        estimate: The offset so far.
    """

    def __init__(self, history: EncoderHistory, bands: int, limit: float) -> None:
        """Start without sightings.

        Args:
            history: The encoder's readings.
            bands: Number of bands, P0 first.
            limit: Largest offset that has to be found [s].
        """
        self.estimate = ClockEstimate()
        self._history = history
        self._reach = limit + BEYOND
        shape = (bands, ROWS)
        self._t = np.full(shape, np.nan)
        self._azimuth = np.full(shape, np.nan)
        # Reading and speed at the stamp less `at`; nan before the encoder has come so far.
        self._angle = np.zeros(shape)
        self._speed = np.zeros(shape)
        self._at = np.full(shape, np.nan)
        self._count = np.ones(shape)
        self._place = np.zeros(bands, dtype=int)
        self._frames = 0
        self._best, self._best_at = math.inf, 0.0
        # Speeds at which bands were seen, and their range at the last estimate [rad/s].
        self._slowest, self._fastest, self._span = math.inf, 0.0, 0.0

    def add(self, t: float, azimuths: FloatArray) -> None:
        """Take what was seen in a frame.

        Args:
            t: Its stamp [s].
            azimuths: Of the bands [rad], nan where not seen, shape (bands,).
        """
        if not len(self._history):
            return
        for n in np.flatnonzero(np.isfinite(azimuths)):
            self._store(int(n), t, float(azimuths[n]))
        self._frames += 1
        # Another speed tells more of an offset that is not known, another sighting of it little.
        span = self._fastest - self._slowest
        more = not self.estimate.known and span > MORE_SPEEDS * self._span
        if (more or self._frames % REFINED_EVERY == 0) and self._moving():
            self._span = span
            self._refine()

    def _store(self, n: int, t: float, azimuth: float) -> None:
        place = self._place[n]
        last = (place - 1) % ROWS
        passed = abs(t - self._t[n, last])
        turned = abs(azimuth - self._azimuth[n, last])
        speed = abs(float(self._history.speeds(np.array([t]))[0]))
        self._slowest, self._fastest = min(self._slowest, speed), max(self._fastest, speed)
        stands = speed < LEAST_SPAN
        if turned < SPACING_ANGLE and passed < (SPACING_REST if stands else SPACING_TIME):
            return
        self._t[n, place], self._azimuth[n, place], self._at[n, place] = t, azimuth, np.nan
        self._count[n, place] = max(math.cos(azimuth), 0.0) ** FACING
        self._place[n] = (place + 1) % ROWS

    def _moving(self) -> bool:
        """Return whether the cylinder turned since the oldest sighting that has not settled."""
        if not np.isfinite(self._t).any():
            return False
        span = np.array([np.nanmin(self._t) - self._reach, self._history.newest])
        before, now = self._history.angles(span)
        return bool(abs(now - before) > REST_ANGLE)

    def _refine(self) -> None:
        """Fit the offset to everything that is kept."""
        old = self.estimate
        found = old if old.known else ClockEstimate(offset=self._search())
        robust = np.ones(self._t.shape)
        for _ in range(STEPS):
            self._linearise(found.offset)
            found, robust = self._solve(found.offset, robust)
        now = self._history.newest
        if found.error <= self._best:
            self._best, self._best_at = found.error, now
        if old.known and found.error > self._best + DRIFT * (now - self._best_at):
            found = replace(old, shift=old.shift if math.isnan(found.shift) else found.shift)
        self.estimate = found

    def _search(self) -> float:
        """Return the offset [s] of a grid that explains P0's sightings best."""
        rows = np.isfinite(self._t[0])
        if not rows.any():
            return 0.0
        grid = np.arange(-self._reach, self._reach + 0.5 * GRID, GRID)
        instants = self._t[0, rows] - grid[:, None]
        covered = instants >= self._history.oldest
        if not covered.all(axis=0).any():
            return 0.0
        residual = np.where(
            covered, self._azimuth[0, rows] - self._history.angles(instants), np.nan
        )
        middle = np.nanmedian(residual, axis=1)[:, None]
        cost = np.nanmean(np.abs(residual - middle), axis=1)
        cost += PREFERENCE * np.abs(grid) / self._reach
        return float(grid[int(np.argmin(cost))])

    def _linearise(self, offset: float) -> None:
        """Read the encoder where the sightings were, if the offset is this one."""
        instants = self._t - offset
        covered = (instants <= self._history.newest) & (instants >= self._history.oldest)
        self._angle[covered] = self._history.angles(instants[covered])
        self._speed[covered] = self._history.speeds(instants[covered])
        self._at[covered] = offset

    def _solve(self, offset: float, robust: FloatArray) -> tuple[ClockEstimate, FloatArray]:
        """Take one Gauss-Newton step from an offset [s] and return the next robust weights.

        Args:
            offset: About which residuals are linear [s].
            robust: Weights of the sightings, shape (bands, ROWS).
        """
        seen = np.isfinite(self._at)
        weight = np.where(seen, robust * self._count, 0.0)
        total = np.maximum(weight.sum(axis=1), LEAST_TOTAL)

        def mean(values: FloatArray) -> FloatArray:
            result: FloatArray = np.einsum("nk,nk->n", weight, values) / total
            return result

        speed = np.where(seen, self._speed, 0.0)
        residual = self._azimuth - self._angle + self._speed * (offset - self._at)
        residual = np.where(seen, residual, 0.0)
        mean_speed, mean_residual = mean(speed), mean(residual)
        rates = np.where(weight > LEAST_WEIGHT, speed, mean_speed[:, None])
        span = float(np.ptp(rates, axis=1).max())
        angle = np.where(seen, self._angle, 0.0)
        speed -= mean_speed[:, None]
        residual -= mean_residual[:, None]
        angle -= mean(angle)[:, None]
        if not seen[0].any():
            mean_residual[0] = math.nan
        if span < LEAST_SPAN:
            return ClockEstimate(offset=offset, shift=float(mean_residual[0])), robust
        columns = (-speed, angle)
        normal = np.array([[(total * mean(a * b)).sum() for b in columns] for a in columns])
        normal[1, 1] += (SYSTEMATIC / MOTION_SIGMA) ** 2
        wanted = np.array([(total * mean(column * residual)).sum() for column in columns])
        step, share = np.linalg.solve(normal, wanted).tolist()
        information = float(normal[0, 0] - normal[0, 1] ** 2 / normal[1, 1])
        moved = min(max(offset + step, -self._reach), self._reach)
        left = residual + speed * (moved - offset) - share * angle
        if abs(moved) == self._reach:
            # An offset at the bound of the search is unknown.
            return ClockEstimate(shift=float(mean_residual[0])), robust
        scatter = max(1.4826 * float(np.median(np.abs(left[seen]))), LEAST_SCATTER)
        variance = max(float((weight * left * left).sum() / weight.sum()), LEAST_SCATTER**2)
        found = ClockEstimate(
            offset=moved,
            error=math.sqrt(variance / information + (SYSTEMATIC / span) ** 2),
            shift=float(mean_residual[0] + mean_speed[0] * (moved - offset)),
        )
        return found, 1.0 / np.maximum(np.abs(left) / (OUTLIER * scatter), 1.0) ** 2


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
    seen): nothing while the machine stands, most behind the ramp.

    Attributes:
        settings: What to do about it.
        withheld: Whether markers of the last frame were withheld.
        applied: Whether the offset is corrected by now.
    """

    def __init__(
        self, settings: ClockSettings, config: TrackerConfig, history: EncoderHistory
    ) -> None:
        """Start with nothing known.

        Args:
            settings: What to do about the offset.
            config: Of the tracker.
            history: The encoder's readings.
        """
        self.settings = settings
        self.withheld = False
        self._history = history
        self._offset = ClockOffset(history, config.marker_count + 1, settings.limit)
        self._tolerance = max(LENGTH_SHARE * config.expected_gap, _FIRST_ERROR)
        self._allowed = WITHHELD_PART * self._tolerance
        self._gap = config.expected_gap
        self._fastest = 0.0
        # Mean speed at which the tracker's shift was measured, and its weight in frames.
        self._usual = 0.0
        self._weight = 0.0
        self._strayed = 0.0
        self._missed = 0
        self.applied = False

    @property
    def estimate(self) -> ClockEstimate:
        """The offset so far."""
        return self._offset.estimate

    def lead(self, t: float, angle: float, shift: float) -> float:
        """Return how much further than by reading and shift P0 stands in a frame [rad].

        Args:
            t: Stamp of the frame [s].
            angle: Reading that the frame is paired with [rad].
            shift: See `Run` [rad].
        """
        # Every second frame without P0 asks the encoder alone, should the estimate be wrong.
        if not math.isfinite(self.estimate.shift) or self._missed % 2:
            return 0.0
        then = np.array([t - self.estimate.offset])
        return float(self._history.angles(then)[0]) + self.estimate.shift - angle - shift

    def take(self, t: float, azimuths: FloatArray) -> None:
        """Take what was seen in a frame that had a reading.

        Args:
            t: Its stamp [s].
            azimuths: Of the bands [rad], nan where not seen, shape (markers,).
        """
        self._offset.add(t, azimuths)
        speed = self._speed(t)
        sure = math.isfinite(self.estimate.error) and self._doubt(speed) <= self._allowed
        self.applied = self.applied or (self.settings.correct and sure)
        self._fastest = max(self._fastest, abs(speed))
        if math.isfinite(azimuths[0]):
            self._weight += 1.0
            self._usual += max(1.0 / self._weight, SHIFT_SHARE) * (speed - self._usual)
            self._missed = 0
        else:
            self._missed += 1

    def stray(self, lead: float) -> None:
        """Take note of a frame whose stamp lies far outside the encoder's readings.

        Args:
            lead: How far it is ahead of them, negative for behind [s].
        """
        self._strayed = lead

    def trusts(self, t: float) -> bool:
        """Return whether what is unknown of the offset leaves a frame's lengths alone."""
        usual = 0.0 if self.applied else self._usual
        return self._doubt(self._speed(t) - usual) <= self._allowed

    @property
    def refusal(self) -> str:
        """Why frames cannot be used; empty while they can."""
        limit = f"limit camera_clock_limit {self.settings.limit / MILLISECOND:.0f} ms"
        return f"{_ahead(self._strayed)}, {limit}: frames are refused" if self._strayed else ""

    @property
    def warning(self) -> str:
        """What is wrong with lengths because of the clock; empty while nothing is."""
        estimate = self.estimate
        wrong = abs(estimate.offset) * self._fastest + self._doubt(self._fastest)
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

    def _doubt(self, speed: float) -> float:
        """Return by how much an angle may be wrong for what is not known of the offset [rad]."""
        return min(SIGMAS * self.estimate.error, self.settings.limit) * abs(speed)

    def _speed(self, t: float) -> float:
        return float(self._history.speeds(np.array([t - self.estimate.offset]))[0])


def _ahead(offset: float) -> str:
    way = "ahead of" if offset > 0.0 else "behind"
    return f"the camera's clock is {abs(offset) / MILLISECOND:.1f} ms {way} the encoder's"
