"""What the nodes say of themselves: a table of all, and warnings beside Start."""

from __future__ import annotations

import math
from dataclasses import dataclass

from winding_core.status import Level
from winding_dashboard.page.numbers import DASH
from winding_dashboard.state.health import Health

_MOST = 12
_LEVELS = {
    Level.OK: ("ok", "quiet"),
    Level.WARN: ("warning", "warn"),
    Level.ERROR: ("ERROR", "bad"),
    Level.STALE: ("silent", "warn"),
}


@dataclass(frozen=True, kw_only=True)
class NodeLine:
    """One node's row.

    Attributes:
        name: Of the node.
        lifecycle: State of it, or a dash.
        level: In a word.
        style: Of that word.
        message: What the node says.
    """

    name: str
    lifecycle: str
    level: str
    style: str
    message: str


def node_lines(health: Health, now: float) -> list[NodeLine]:
    """Return a row for every node at wall time now [s]."""
    return [
        NodeLine(
            name=row.name,
            lifecycle=row.lifecycle or DASH,
            level=_LEVELS[row.level][0],
            style=_LEVELS[row.level][1],
            message=row.message,
        )
        for row in health.rows(now)[:_MOST]
    ]


def warnings_told(health: Health, now: float) -> list[tuple[str, str]]:
    """Return style and sentence of every node that warns, at wall time now [s].

    A node that was never heard is no warning: a played bag has no machine.
    """
    return [
        (_LEVELS[row.level][1], f"{row.name}: {row.message}")
        for row in health.rows(now)
        if row.level in (Level.WARN, Level.ERROR)
        or (row.level is Level.STALE and math.isfinite(health.silent_for(row.name, now)))
    ]
