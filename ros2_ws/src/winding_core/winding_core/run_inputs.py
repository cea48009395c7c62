"""The inputs of a run: planned from a drive, recorded with a bound, and as a file."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from winding_core.history import History
from winding_core.machine.drive import DriveProfile
from winding_core.machine.readings import AxisReading, GuidePlace
from winding_core.parameters import parameter

# t [s], both axes and guide as in AxisReading, tension [N]; nan where no tension had been read
# yet, and where the guide keeps its place.
AXES = ("cylinder_angle", "angular_speed", "carriage_position", "feed_speed")
INPUT_DTYPE = np.dtype([(name, "<f8") for name in ("t", *AXES, "tension", "guide_x", "guide_y")])


@dataclass(frozen=True, kw_only=True)
class ReplayParameters:
    """Of a node that takes up a run in the middle."""

    replay: str = parameter(
        "", "file of a run's inputs so far, written by the orchestrator, to take up the run with"
    )


class RunInputsError(ValueError):
    """A file does not hold the inputs of a run."""


@dataclass(frozen=True, kw_only=True)
class RunInputs:
    """Encoder samples of a run with the tension that was known at each."""

    samples: NDArray[Any]  # Shape (n,) of INPUT_DTYPE, ascending in time

    def __post_init__(self) -> None:
        times = self.samples["t"]
        if not (np.isfinite(times).all() and (np.diff(times) >= 0.0).all()):
            raise RunInputsError("the times of a run's inputs must ascend")

    def write(self, file: Path) -> None:
        """Write the inputs as a NumPy file."""
        with file.open("wb") as target:
            np.save(target, self.samples, allow_pickle=False)

    @classmethod
    def read(cls, file: Path) -> RunInputs:
        """Return the inputs of a NumPy file.

        Raises:
            FileNotFoundError: There is no such file.
            RunInputsError: It holds something else.
        """
        with file.open("rb") as source:
            try:
                samples = np.load(source, allow_pickle=False)
            except (ValueError, EOFError, OSError, BadZipFile, MemoryError) as error:
                # A head may claim more samples than there is memory.
                raise RunInputsError(f"{file} holds no inputs of a run: {error}") from error
        if not isinstance(samples, np.ndarray) or samples.dtype != INPUT_DTYPE:
            raise RunInputsError(f"{file} holds no inputs of a run")
        return cls(samples=samples)

    def __iter__(self) -> Iterator[tuple[float, AxisReading, float | None]]:
        """Yield (t [s], reading, tension [N] or None)."""
        for sample in self.samples:
            tension, x = float(sample["tension"]), float(sample["guide_x"])
            yield (
                float(sample["t"]),
                AxisReading(
                    **{name: float(sample[name]) for name in AXES},
                    guide=None if np.isnan(x) else GuidePlace(x=x, y=float(sample["guide_y"])),
                ),
                None if np.isnan(tension) else tension,
            )


# Shape (n,) of INPUT_DTYPE; t since the start of the run, a tension of nan is the model's own.
Inputs = NDArray[np.void]
# Fields of INPUT_DTYPE before the tension; sum and number of tensions that were read; the guide.
_Row = tuple[float, float, float, float, float, float, int, float, float]
_KEPT = GuidePlace(x=math.nan, y=math.nan)


class RunHistory:
    """Keeps one sample of a run's inputs per period, and never more than a number of them.

    A full history drops every second sample and doubles its period (see `History`). Between
    samples a model follows a cubic through positions and speeds, which a winding machine leaves
    by less than its encoder's step. A kept tension is the mean of what was read since the sample
    before.
    """

    def __init__(self, *, period: float = 0.02, capacity: int = 4096) -> None:
        if not (math.isfinite(period) and period > 0.0):
            raise ValueError(f"period must be positive and finite, got {period} s")
        if capacity < 4:
            raise ValueError(f"capacity must be at least 4 samples, got {capacity}")
        self._step = period
        self._rows: History[_Row] = History(newest=0, older=capacity, merge=_with_tensions_of)
        self._last = self._due = -math.inf
        self._pulls = 0.0
        self._pull_count = 0

    @property
    def inputs(self) -> Inputs:
        """The kept samples, shape (n,), a copy."""
        rows = [(*row[:5], row[5] / row[6] if row[6] else math.nan, *row[7:]) for row in self._rows]
        return np.array(rows, dtype=INPUT_DTYPE)

    @property
    def period(self) -> float:
        """Time between kept samples [s]; grows with the run."""
        return self._step * self._rows.stride

    @property
    def duration(self) -> float:
        """Time of the last kept sample [s]; zero before the first."""
        return self._rows[-1][0] if self._rows else 0.0

    @property
    def latest(self) -> float:
        """Time of the newest sample, kept or not [s]; minus infinity before the first."""
        return self._last

    def __len__(self) -> int:
        return len(self._rows)

    def record(self, t: float, reading: AxisReading, tension: float | None) -> None:
        """Take a sample of the machine at a time since the start of the run [s].

        Args:
            t: [s], later than every time before.
            reading: Both axes.
            tension: Measured span tension [N]; None where the model's own law holds.

        Raises:
            ValueError: Time does not ascend or is not finite.
        """
        if not (math.isfinite(t) and t > self._last):
            raise ValueError(f"times of a run must ascend: after {self._last} s came {t} s")
        self._last = t
        if tension is not None:
            self._pulls += tension
            self._pull_count += 1
        if t < self._due:
            return
        # Half a millisecond early, so that rounding never makes a sample late.
        self._due = t + self._step - 5.0e-4
        guide = reading.guide or _KEPT
        self._rows.append((t, *reading.numbers, self._pulls, self._pull_count, guide.x, guide.y))
        self._pulls, self._pull_count = 0.0, 0


def _with_tensions_of(earlier: _Row, later: _Row) -> _Row:
    return (*later[:5], earlier[5] + later[5], earlier[6] + later[6], *later[7:])


def no_inputs(count: int) -> Inputs:
    """Return so many samples at zero, without tension, of a guide that keeps its place."""
    inputs = np.zeros(count, dtype=INPUT_DTYPE)
    for name in ("tension", "guide_x", "guide_y"):
        inputs[name] = math.nan
    return inputs


def planned_inputs(
    drive: DriveProfile, duration: float, *, tension: float | None = None, period: float = 0.02
) -> Inputs:
    """Return the inputs of a run that goes as planned, shape (n,), t = 0 included.

    Raises:
        ValueError: The duration [s] is not positive and finite.
    """
    if not (math.isfinite(duration) and duration > 0.0):
        raise ValueError(f"duration must be positive and finite, got {duration}")
    times = np.linspace(0.0, duration, max(1, math.ceil(duration / period - 1.0e-9)) + 1)
    inputs = no_inputs(times.size)
    inputs["t"] = times
    inputs["cylinder_angle"], inputs["carriage_position"] = drive.positions(times)
    inputs["angular_speed"], inputs["feed_speed"] = drive.speeds(times)
    inputs["tension"] = math.nan if tension is None else tension
    return inputs


def continued_inputs(inputs: Inputs, angle: float, *, period: float = 0.02) -> Inputs:
    """Return inputs that go on at the run's top speeds until the cylinder has reached an angle.

    The tension stays the mean of the last second.

    Args:
        inputs: Of the run so far, shape (n,), n >= 1.
        angle: Cylinder angle to reach [rad].
        period: Time between the added samples [s].
    """
    last = inputs[-1]
    left = angle - float(last["cylinder_angle"])
    speed = float(inputs["angular_speed"].max())
    if left <= 0.0 or speed <= 0.0:
        return inputs
    feed = float(inputs["feed_speed"][np.abs(inputs["feed_speed"]).argmax()])
    count = math.ceil(left / (speed * period))
    after = period * np.arange(1, count + 1)
    more = np.zeros(count, dtype=INPUT_DTYPE)
    more["t"] = last["t"] + after
    more["cylinder_angle"] = last["cylinder_angle"] + speed * after
    more["carriage_position"] = last["carriage_position"] + feed * after
    more["angular_speed"], more["feed_speed"] = speed, feed
    more["tension"] = inputs["tension"][inputs["t"] >= last["t"] - 1.0].mean()
    more["guide_x"], more["guide_y"] = last["guide_x"], last["guide_y"]
    return np.concatenate([inputs, more])


def planned_rest(inputs: Inputs, drive: DriveProfile, duration: float) -> Inputs:
    """Return the inputs that a plan has left, beginning where the machine stands now.

    The plan is entered where it has the cylinder's angle, so a run that was stopped for a while
    goes on. The tension stays the mean of the last second.

    Args:
        inputs: Of the run so far, shape (n,), n >= 1.
        drive: The plan.
        duration: Planned time of the whole run [s].
    """
    last = inputs[-1]
    angle, carriage = float(last["cylinder_angle"]), float(last["carriage_position"])
    entered = drive.time_at_angle(max(angle, 0.0))
    if entered >= duration:
        return np.zeros(0, dtype=INPUT_DTYPE)
    plan = planned_inputs(drive, duration)
    rest: Inputs = plan[plan["t"] > entered + 1.0e-6]
    _, planned_carriage = drive.positions(entered)
    rest["t"] += float(last["t"]) - entered
    rest["carriage_position"] += carriage - planned_carriage
    rest["tension"] = inputs["tension"][inputs["t"] >= last["t"] - 1.0].mean()
    rest["guide_x"], rest["guide_y"] = last["guide_x"], last["guide_y"]
    return rest
