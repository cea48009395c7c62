"""What a run leaves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from winding_core.run_options import OperatorLimits
from winding_core.run_outcome import Ending
from winding_recorder.live.run_buffer import RunBuffer


@dataclass(frozen=True, kw_only=True)
class RunResult:
    """What a run leaves."""

    buffer: RunBuffer  # Every message but the pictures
    wall_s: float  # How long the run took [s]
    ending: Ending  # How it ended
    losses: tuple[str, ...] = ()  # What of its files is missing, a sentence each
    # Parameters of the machine in a run that an operator conducted; empty when none was begun
    wound: Mapping[str, object] = field(default_factory=dict)
    bags: tuple[Path, ...] = ()  # What was recorded
    limits: OperatorLimits | None = None  # Of the operator's page at its end
    simulated: bool = True  # Whether its machine was the simulated one, sampled at known instants
    # What the nodes noted of the corrected lengths, TRACE_DTYPE, shape (n,); None without a trace
    trace: NDArray[np.void] | None = None
