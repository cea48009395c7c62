"""Processor time of a process and all its children, and what a stretch of a run took."""

from __future__ import annotations

import os
from dataclasses import dataclass

import psutil


@dataclass(frozen=True, kw_only=True)
class Cost:
    """What a graph of processes takes in steady state.

    Attributes:
        by_process: Processor time per simulated second [s/s], by name.
        load: The machine's load average at its end.
    """

    by_process: dict[str, float]
    load: float

    @property
    def total(self) -> float:
        """Of all processes [s/s]."""
        return sum(self.by_process.values())


def spent(root: psutil.Process) -> dict[int, float]:
    """Return the processor time so far [s] of a process and of its children, by process id."""
    times = {}
    for process in (root, *root.children(recursive=True)):
        try:
            used = process.cpu_times()
        except psutil.Error:
            continue
        times[process.pid] = used.user + used.system
    return times


def cost_between(
    before: dict[int, float], after: dict[int, float], seconds: float, names: dict[int, str]
) -> Cost:
    """Return what those processes took that lived at both ends.

    Args:
        before: See `spent`.
        after: See `spent`.
        seconds: Simulated, between both.
        names: Of the processes; others count as "other".
    """
    by_process: dict[str, float] = {}
    for pid in before.keys() & after.keys():
        name = names.get(pid, "other")
        by_process[name] = by_process.get(name, 0.0) + (after[pid] - before[pid]) / seconds
    return Cost(by_process=dict(sorted(by_process.items())), load=os.getloadavg()[0])
