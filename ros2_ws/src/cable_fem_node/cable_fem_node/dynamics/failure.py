"""How a run fails: loudly, with the time, the element and the cause."""

from __future__ import annotations


class SolverError(RuntimeError):
    """A run has no result that could be trusted."""


class DivergenceError(SolverError):
    """The integration left the range of physics; the message names time, element and cause."""


class EnergyBalanceError(SolverError):
    """A run's energy balance is open: its numbers cannot be trusted."""


class ImpossibleResultError(SolverError):
    """A run ended with cable that cannot lie so."""
