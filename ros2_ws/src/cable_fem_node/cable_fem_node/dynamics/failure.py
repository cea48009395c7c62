"""How a run fails: loudly, with the time, the element and the cause."""

from __future__ import annotations


class DivergenceError(RuntimeError):
    """The integration left the range of physics; says when, where and why."""


class EnergyBalanceError(RuntimeError):
    """A run's energy balance is open: its numbers cannot be trusted."""
