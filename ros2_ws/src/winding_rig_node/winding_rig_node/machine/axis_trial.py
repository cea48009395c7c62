"""A run of the simulated machine's two axes alone, without a graph."""

from __future__ import annotations

from dataclasses import astuple

import numpy as np
from numpy.typing import NDArray

from winding_rig_node.machine.machine import Machine
from winding_rig_node.machine.machine_config import SAMPLE_RATE, MachineConfig


def axis_trial(config: MachineConfig, seed: int = 0) -> NDArray[np.float64]:
    """Drive both axes through a run.

    Returns:
        A row for each sample, shape (n, 9): time [s], then angle, speed, carriage position and
        carriage speed as `AxisReading` has them, measured and then commanded.
    """
    machine = Machine(config, np.random.default_rng(seed))
    machine.start()
    rows = []
    for _ in range(round(config.duration * SAMPLE_RATE)):
        machine.step()
        rows.append((machine.time, *astuple(machine.reading()), *astuple(machine.setpoints())))
    return np.array(rows)
