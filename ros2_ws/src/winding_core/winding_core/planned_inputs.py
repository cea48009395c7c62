"""The inputs of a run that has not happened yet: as planned, or going on from where it stands."""

from __future__ import annotations

import math

import numpy as np

from winding_core.machine.drive import DriveProfile
from winding_core.run_inputs import INPUT_DTYPE, Inputs


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
    inputs = np.zeros(times.size, dtype=INPUT_DTYPE)
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
    return rest
