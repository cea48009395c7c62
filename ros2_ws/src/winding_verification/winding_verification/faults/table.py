"""The rows of the fault table, in the order in which they are tried."""

from __future__ import annotations

import signal
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from winding_ros import topics
from winding_ros.graph import GRAPH
from winding_verification.faults.cell import FaultCell
from winding_verification.faults.node_faults import (
    lose_again_and_again,
    lose_node,
    lose_successor,
)
from winding_verification.faults.orchestrator_faults import lose_orchestrator, second_graph
from winding_verification.faults.outcome import Outcome
from winding_verification.faults.sensor_faults import (
    STOPPING,
    SensorFault,
    break_sensor,
    lose_frames,
)
from winding_verification.faults.stranger_faults import (
    late_joiner,
    quality_mismatch,
    rogue_publisher,
    wrong_parameters,
)

Trial = Callable[[FaultCell, Path], Awaitable[Outcome]]


@dataclass(frozen=True, kw_only=True)
class Row:
    """One fault.

    Attributes:
        name: As the table calls it.
        try_it: Puts it into a cell that it may ruin; the cell heals itself before the next.
            The folder is the row's own.
    """

    name: str
    try_it: Trial


@dataclass(frozen=True, kw_only=True)
class LoneRow:
    """A fault that needs a run of its own, beside no cell.

    Attributes:
        name: As the table calls it.
        try_it: Makes the run in a new folder and ruins it.
    """

    name: str
    try_it: Callable[[Path], Awaitable[Outcome]]


def _alone(trial: Callable[[FaultCell], Awaitable[Outcome]]) -> Trial:
    """Return a trial that needs no folder."""

    def try_it(cell: FaultCell, _folder: Path) -> Awaitable[Outcome]:
        return trial(cell)

    return try_it


def _sensor_row(fault: SensorFault) -> Row:
    return Row(name=fault.name, try_it=_alone(partial(break_sensor, fault=fault)))


def _node_row(words: str, number: signal.Signals, name: str) -> Row:
    return Row(name=f"{words} {name}", try_it=_alone(partial(lose_node, name=name, number=number)))


ROWS = (
    Row(name="20 % frame loss", try_it=_alone(lose_frames)),
    Row(name="wrong parameters", try_it=_alone(wrong_parameters)),
    Row(name="late joiner", try_it=_alone(late_joiner)),
    Row(name="QoS mismatch", try_it=_alone(quality_mismatch)),
    Row(name="rogue publisher", try_it=_alone(rogue_publisher)),
    Row(name="two rigs on one machine", try_it=second_graph),
    *map(_sensor_row, STOPPING),
    *(_node_row("kill -9", signal.SIGKILL, spec.name) for spec in GRAPH),
    *(_node_row("SIGSTOP", signal.SIGSTOP, spec.name) for spec in GRAPH),
    Row(
        name="a successor that hangs",
        try_it=_alone(partial(lose_successor, name=topics.TRACKER)),
    ),
    Row(
        name="a node that dies again and again",
        try_it=_alone(partial(lose_again_and_again, name=topics.TRACKER)),
    ),
)
LONE_ROWS = (
    LoneRow(name="kill -9 orchestrator", try_it=partial(lose_orchestrator, number=signal.SIGKILL)),
    LoneRow(name="SIGSTOP orchestrator", try_it=partial(lose_orchestrator, number=signal.SIGSTOP)),
)
