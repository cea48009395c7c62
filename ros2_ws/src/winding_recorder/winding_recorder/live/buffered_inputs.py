"""The inputs of a run as its buffer has them."""

from __future__ import annotations

import numpy as np

from winding_core.run_inputs import INPUT_DTYPE, RunInputs
from winding_recorder.live.run_buffer import RunBuffer
from winding_ros import topics
from winding_ros.messages.rig import decode_tension


def buffered_inputs(buffer: RunBuffer, since: float = 0.0) -> RunInputs:
    """Return the usable encoder samples with the tension that was the newest then.

    The buffer of a long run is thinned. A model follows a cubic between samples, which a winding
    machine leaves by less than its encoder's step.

    Args:
        buffer: What the graph has said.
        since: Leaves out what came before this monotonic wall time [s].
    """
    readings = list(buffer.axis_readings(since))
    tensions = list(buffer.readings(topics.TENSION, decode_tension, since))
    samples = np.full(len(readings), np.nan, dtype=INPUT_DTYPE)
    samples["t"] = [t for t, _ in readings]
    for name in ("cylinder_angle", "angular_speed", "carriage_position", "feed_speed"):
        samples[name] = [getattr(reading, name) for _, reading in readings]
    if tensions:
        times = np.array([t for t, _ in tensions])
        forces = np.array([force for _, force in tensions])
        newest = np.searchsorted(times, samples["t"], side="right") - 1
        samples["tension"] = np.where(newest >= 0, forces[np.maximum(newest, 0)], np.nan)
    return RunInputs(samples=samples)
