"""A recorded run as an identification takes it, from the rows of its messages."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from cable_fem_node.identification import TrackedRun
from cable_fem_node.identification.steady import SteadyMarkers
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.markers import MARKER_DTYPE
from winding_core.readings import AxisReading
from winding_core.run_inputs import Inputs, RunHistory
from winding_study.identification.tables import SourceError

# Messages of one topic, each as rows by column name.
Messages = Sequence[Sequence[dict[str, Any]]]


def recorded_run(
    config: WindingConfig, *, tracked: Messages, joints: Messages, tension: Messages
) -> TrackedRun:
    """Return what a recording says of markers, machine and load cell.

    Args:
        config: What was wound.
        tracked: tracker/markers.
        joints: rig/joint_states; at least one message.
        tension: rig/tension.

    Raises:
        SourceError: A column is missing, or no marker was measured.
    """
    steady = SteadyMarkers()
    try:
        for rows in tracked:
            records = np.zeros(len(rows), dtype=MARKER_DTYPE)
            for name in MARKER_DTYPE.names or ():
                records[name] = [row[name] for row in rows]
            steady.add(records)
        inputs = _inputs(_flat(joints), _flat(tension))
    except KeyError as error:
        raise SourceError(f"the recording lacks {error}") from error
    readings = steady.readings()
    if readings is None:
        raise SourceError("no marker of the recording was measured steadily")
    return TrackedRun(config=config, inputs=inputs, readings=readings)


def _flat(messages: Messages) -> list[dict[str, Any]]:
    return [row for rows in messages for row in rows]


def _inputs(joints: Sequence[dict[str, Any]], pulls: Sequence[dict[str, Any]]) -> Inputs:
    pull_times = np.array([row["t"] for row in pulls])
    history = RunHistory()
    begin = float(joints[0]["t"])
    last = -math.inf
    for row in joints:
        t = float(row["t"]) - begin
        if t <= last:
            continue
        last = t
        newest = int(np.searchsorted(pull_times, row["t"] + 1.0e-6, side="right")) - 1
        force = None if newest < 0 else max(float(pulls[newest]["wrench.force.x"]), 0.0)
        reading = AxisReading(
            cylinder_angle=row["cylinder_joint.position"],
            angular_speed=row["cylinder_joint.velocity"],
            carriage_position=row["carriage_joint.position"],
            feed_speed=row["carriage_joint.velocity"],
        )
        history.record(t, reading, force)
    return history.inputs
