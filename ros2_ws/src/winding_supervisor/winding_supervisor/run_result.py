"""What a run leaves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from winding_core.run_options import OperatorLimits
from winding_recorder.live.run_buffer import RunBuffer
from winding_supervisor.event_log import Event


@dataclass(frozen=True, kw_only=True)
class RunResult:
    """What a run leaves.

    Attributes:
        buffer: Every message but the pictures.
        wall_s: How long the run took [s].
        recording_error: What ended the bag before the run, if anything did.
        events: What supervision saw and did; nothing in a run without failures.
        wound: Parameters of the machine in a run that an operator conducted; nothing when none
            was begun.
        bags: What was recorded.
        ended: Why the run ended before its end; empty for one that came to its end.
        limits: What an operator called good at its end; None of a run without a page.
        simulated: Whether its machine was the simulated one, with samples at known instants.
        trace: What the nodes noted of the corrected lengths, TRACE_DTYPE, shape (n,); None in a
            run without a trace.
    """

    buffer: RunBuffer
    wall_s: float
    recording_error: Exception | None = None
    events: tuple[Event, ...] = ()
    wound: Mapping[str, object] = field(default_factory=dict)
    bags: tuple[Path, ...] = ()
    ended: str = ""
    limits: OperatorLimits | None = None
    simulated: bool = True
    trace: NDArray[np.void] | None = None
