"""Health of the graph's nodes: diagnostics, lifecycle state, and the recorder's report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from winding_core.status import Level, Status

RECORDER = "recorder"
_UNITS = (("GB", 1e9), ("MB", 1e6), ("kB", 1e3))
_DIGITS = 19
SILENCE = 3.5  # A node repeats its state every second; one that misses three is not heard
# Names of external nodes that are kept before the oldest are forgotten.
_MOST_NODES = 24
_MOST_PARTS = 16
# Lifecycle states in which a node does its work; a busy one does not answer at once.
_WORKING = ("active", "no answer")


def recording_sentence(message: str, values: Mapping[str, str]) -> str:
    """Return what an operator reads of the recorder's message and values in /diagnostics."""
    if not values.get("bag"):
        return message if "ended" in values else "nothing is being recorded"
    count, size, lost = (_whole(values.get(name, "")) for name in ("messages", "bytes", "lost"))
    unit, factor = next((unit for unit in _UNITS if size >= unit[1]), ("bytes", 1))
    written = f"{count:,} messages, {size / factor:.{1 if factor > 1 else 0}f} {unit}"
    missing = f", {lost} never arrived" if lost else ""
    return f"into {values['bag']}: {written.replace(',', ' ', 1)}{missing}"


def _whole(text: str) -> int:
    """Return a whole number that any node may have published; 0 for none."""
    return int(text) if text.isascii() and text.isdecimal() and len(text) < _DIGITS else 0


@dataclass(frozen=True, kw_only=True)
class NodeHealth:
    """One row of the list of nodes."""

    name: str  # Node name
    lifecycle: str  # State of the managed node; empty without an answer
    level: Level  # The worst of its components; STALE when it is not heard
    message: str  # One sentence for each component


class Health:
    """Collects statuses and lifecycle states by node.

    Args:
        nodes: Names of the nodes that are shown from the start, in order.
    """

    def __init__(self, nodes: Sequence[str]) -> None:
        self._expected = tuple(nodes)
        self._reports: dict[str, dict[str, Status]] = {}
        self._heard: dict[str, float] = {}
        self.first_heard = float("inf")  # Wall time of the first report [s]; inf before any
        self.lifecycle: dict[str, str] = {}  # State of each node that answers, by name

    @property
    def last_heard(self) -> float:
        """Wall time of the newest report [s]; -inf before any."""
        return max(self._heard.values(), default=float("-inf"))

    def note(self, now: float, statuses: Sequence[Status]) -> None:
        """Take the statuses of one message, received at wall time now [s]."""
        self.first_heard = min(self.first_heard, now)
        for status in statuses:
            node = node_of(status.name)
            parts = self._reports.setdefault(node, {})
            parts[status.name] = status
            if len(parts) > _MOST_PARTS:
                parts.pop(next(iter(parts)))
            self._heard[node] = now
        while len(self._reports) > _MOST_NODES:
            external = next(name for name in self._reports if name not in self._expected)
            del self._reports[external], self._heard[external]

    def message(self, node: str) -> str:
        """Return the last message of a node, or of a component such as `orchestrator: run`."""
        report = self._reports.get(node_of(node), {}).get(node)
        return "" if report is None else report.message

    def values(self, component: str) -> Mapping[str, str]:
        """Return what a component such as `winding_rig: topics` last measured."""
        report = self._reports.get(node_of(component), {}).get(component)
        return {} if report is None else report.values

    def silent_for(self, node: str, now: float) -> float:
        """Return for how long nothing was heard of a node, at wall time now [s]; inf if ever."""
        return now - self._heard.get(node, float("-inf"))

    def forget(self, node: str) -> None:
        """Forget what a node has reported of itself: it begins anew."""
        self._reports.pop(node, None)

    def works(self, node: str) -> bool:
        """Return whether a node has the lifecycle state in which it works, or none is known."""
        return self.lifecycle.get(node, "active") in _WORKING

    def down(self, now: float) -> dict[str, str]:
        """Return what keeps a node from its work by its name, at wall time now [s].

        Nodes that neither report nor answer from the start may be there without either.
        """
        found = {}
        for name in dict.fromkeys((*self._expected, *self.lifecycle)):
            silent = self.silent_for(name, now)
            if not self.works(name):
                found[name] = f"{name} is {self.lifecycle[name]}"
            elif self.lifecycle.get(name) != "active" and SILENCE < silent < float("inf"):
                found[name] = f"{name} is silent for {silent:.0f} s"
        return found

    def unanswered(self) -> str:
        """Return an expected node whose lifecycle state is not known; empty when all are."""
        return next((name for name in self._expected if name not in self.lifecycle), "")

    def rows(self, now: float) -> list[NodeHealth]:
        """Return one row for each node at wall time now [s], the expected nodes first."""
        others = [name for name in self._reports if name not in self._expected]
        return [self._row(name, now) for name in (*self._expected, *others)]

    def warnings(self, now: float) -> list[NodeHealth]:
        """Return the rows of the nodes that warn, at wall time now [s].

        A node that was never heard is no warning: a played bag has no machine.
        """
        return [
            row
            for row in self.rows(now)
            if row.level in (Level.WARN, Level.ERROR)
            or (row.level is Level.STALE and row.name in self._heard)
        ]

    def _row(self, name: str, now: float) -> NodeHealth:
        reports = list(self._reports.get(name, {}).values())
        silent = now - self._heard[name] if reports else 0.0
        if reports and silent <= SILENCE:
            level = max(report.level for report in reports)
            messages = dict.fromkeys(report.message for report in reports if report.message)
            message = "; ".join(messages) or "ok"
        else:
            level = Level.STALE
            message = f"silent for {silent:.0f} s" if reports else "no report yet"
        return NodeHealth(
            name=name, lifecycle=self.lifecycle.get(name, ""), level=level, message=message
        )


def node_of(name: str) -> str:
    """Return the node that a status name such as `/winding/winding_rig: topics` is about."""
    return name.split(":", maxsplit=1)[0].strip().rsplit("/", maxsplit=1)[-1]
