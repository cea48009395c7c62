"""How the graph's nodes are: what each says of itself, and in which lifecycle state it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from winding_core.status import Level, Status

# A node repeats its state every second; one that misses three is not heard.
SILENCE = 3.5
# Names that strangers may add before the oldest are forgotten.
_MOST_NODES = 24
_MOST_PARTS = 16


@dataclass(frozen=True, kw_only=True)
class NodeHealth:
    """One row of the list of nodes.

    Attributes:
        name: Node name.
        lifecycle: State of the managed node; empty when nobody answers.
        level: The worst of its components; STALE when it is not heard.
        message: What it says, one sentence for each component.
    """

    name: str
    lifecycle: str
    level: Level
    message: str


class Health:
    """Collects statuses and lifecycle states by node.

    Args:
        nodes: Names of the nodes that are shown from the start, in order.
    """

    def __init__(self, nodes: Sequence[str]) -> None:
        self._expected = tuple(nodes)
        self._reports: dict[str, dict[str, Status]] = {}
        self._heard: dict[str, float] = {}
        self.lifecycle: dict[str, str] = {}

    @property
    def last_heard(self) -> float:
        """Wall time of the newest report [s]; -inf before any."""
        return max(self._heard.values(), default=float("-inf"))

    def note(self, now: float, statuses: Sequence[Status]) -> None:
        """Take the statuses of one message, received at wall time now [s]."""
        for status in statuses:
            node = node_of(status.name)
            parts = self._reports.setdefault(node, {})
            parts[status.name] = status
            if len(parts) > _MOST_PARTS:
                parts.pop(next(iter(parts)))
            self._heard[node] = now
        while len(self._reports) > _MOST_NODES:
            stranger = next(name for name in self._reports if name not in self._expected)
            del self._reports[stranger], self._heard[stranger]

    def message(self, node: str) -> str:
        """Return what the node itself says; empty when it is unknown."""
        return next(
            (
                report.message
                for name, report in self._reports.get(node, {}).items()
                if ":" not in name
            ),
            "",
        )

    def values(self, component: str) -> Mapping[str, str]:
        """Return what a component such as `winding_rig: topics` last measured."""
        report = self._reports.get(node_of(component), {}).get(component)
        return {} if report is None else report.values

    def silent_for(self, node: str, now: float) -> float:
        """Return for how long nothing was heard of a node, at wall time now [s]; inf if ever."""
        return now - self._heard.get(node, float("-inf"))

    def rows(self, now: float) -> list[NodeHealth]:
        """Return one row for each node at wall time now [s], the expected nodes first."""
        others = [name for name in self._reports if name not in self._expected]
        return [self._row(name, now) for name in (*self._expected, *others)]

    def _row(self, name: str, now: float) -> NodeHealth:
        lifecycle = self.lifecycle.get(name, "")
        reports = list(self._reports.get(name, {}).values())
        if not reports:
            return NodeHealth(
                name=name, lifecycle=lifecycle, level=Level.STALE, message="not heard yet"
            )
        silent = now - self._heard[name]
        if silent > SILENCE:
            return NodeHealth(
                name=name,
                lifecycle=lifecycle,
                level=Level.STALE,
                message=f"silent for {silent:.0f} s",
            )
        worst = max(report.level for report in reports)
        said = dict.fromkeys(report.message for report in reports if report.message)
        return NodeHealth(
            name=name, lifecycle=lifecycle, level=worst, message="; ".join(said) or "ok"
        )


def node_of(name: str) -> str:
    """Return the node that a status name such as `/winding/winding_rig: topics` speaks of."""
    return name.split(":", maxsplit=1)[0].strip().rsplit("/", maxsplit=1)[-1]
