"""A model taken along the machine's plan from start to finish, with its markers on the way."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from winding_core.drive import DriveProfile
from winding_core.markers import Markers


class MarkedModel(Protocol):
    """A model that is advanced along the machine's motion and knows its markers."""

    def advance_to(
        self,
        t: float,
        *,
        cylinder_angle: float,
        angular_speed: float,
        guide_z: float,
        feed_speed: float,
    ) -> None:
        """Advance to a time [s] at which the machine stands and moves as given."""

    def markers(self) -> Markers:
        """Return the markers as they lie now."""


@dataclass(frozen=True, kw_only=True)
class FollowedRun:
    """Where the markers were while a model followed a run.

    Attributes:
        times: Shape (frames + 1,) [s], from 0 to the end.
        history: Marker records, shape (frames + 1, markers).
        cpu_seconds: Processor time of the winding alone [s].
    """

    times: NDArray[np.float64]
    history: Markers
    cpu_seconds: float


def refuse_length(duration: float, rate: float) -> None:
    """Refuse a run of no or endless length.

    Raises:
        ValueError: Duration [s] or rate [1/s] is not positive and finite.
    """
    for name, value in (("duration", duration), ("rate", rate)):
        if not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} must be positive and finite, got {value}")


def follow(
    model: MarkedModel,
    drive: DriveProfile,
    duration: float,
    progress: Callable[[float], None] | None,
    *,
    rate: float,
    cpu_clock: Callable[[], float],
) -> FollowedRun:
    """Take a model along a plan.

    Args:
        model: At the start of the run.
        drive: The machine's motion.
        duration: Time to wind [s].
        progress: Called with the share done, 0..1.
        rate: Marker records per second.
        cpu_clock: Processor time [s].

    Raises:
        DivergenceError: The integration failed.
    """
    frames = max(1, math.ceil(duration * rate - 1.0e-9))
    times = duration * np.arange(frames + 1) / frames
    start = model.markers()
    history = np.empty((frames + 1, start.size), dtype=start.dtype)
    history[0] = start
    started = cpu_clock()
    for i, t in enumerate(times[1:].tolist(), start=1):
        angle, guide = drive.positions(t)
        speed, feed = drive.speeds(t)
        model.advance_to(
            t, cylinder_angle=angle, angular_speed=speed, guide_z=guide, feed_speed=feed
        )
        history[i] = model.markers()
        if progress is not None:
            progress(i / frames)
    return FollowedRun(times=times, history=history, cpu_seconds=cpu_clock() - started)
