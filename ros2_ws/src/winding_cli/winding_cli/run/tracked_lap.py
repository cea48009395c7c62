"""The run that was just wound as an identification takes it: motion, pull, markers at the end."""

import math

import numpy as np

from cable_fem_node.identification import IdentificationError, TrackedRun
from cable_fem_node.identification.steady import SteadyMarkers
from cable_fem_node.winding.winding_config import WindingConfig
from winding_recorder.live.run_buffer import RunBuffer, buffered_inputs
from winding_ros import topics
from winding_study.commissioning.design import SEEN_AFTER
from winding_study.commissioning.motion import Motion

# Every marker passes the camera once a turn; of the frames before, slip may have moved it since.
_LAPS = 1.25


def measured_run(
    buffer: RunBuffer, config: WindingConfig, motion: Motion
) -> tuple[TrackedRun, str]:
    """Return a finished run, and the tracker's report on the camera's clock.

    Raises:
        IdentificationError: No marker was measured, or there is no reading of the pull.
    """
    inputs = buffered_inputs(buffer).samples
    if not inputs.size or np.isnan(inputs["tension"]).all():
        raise IdentificationError("the run has no readings of rig/tension: nothing is learned")
    known = np.isfinite(inputs["tension"])
    inputs["tension"] = np.interp(inputs["t"], inputs["t"][known], inputs["tension"][known])
    inputs["t"] -= inputs["t"][0]
    end = float(inputs["cylinder_angle"].max())
    times = inputs["t"][inputs["cylinder_angle"] >= end - _LAPS * 2.0 * math.pi]
    last_lap = buffer.origin + float(times[0])
    steady = SteadyMarkers()
    for t, markers in buffer.readings(topics.TRACKED_MARKERS):
        if t >= last_lap:
            steady.add(markers[markers["theta"] < end - SEEN_AFTER])
    readings = steady.readings()
    if readings is None:
        raise IdentificationError("no marker was measured steadily in the last turn")
    run = TrackedRun(config=config, inputs=inputs, readings=readings, commanded=motion.commanded)
    return run, _clock(buffer)


def _clock(buffer: RunBuffer) -> str:
    values: dict[str, str] = {}
    for status in buffer.statuses():
        if "camera_clock_offset_ms" in status.values:
            values = dict(status.values)
    offset, error = (
        float(values.get(f"camera_clock_offset{name}_ms", "nan")) for name in ("", "_error")
    )
    if not math.isfinite(offset):
        return "camera's clock: unobservable in this run"
    return f"camera's clock: {offset:+.2f} +- {error:.2f} ms ahead of the encoder's"
