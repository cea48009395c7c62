"""State of a node's components, as REP-107 grades it, and the phase of a run among them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, IntEnum


class Level(IntEnum):
    """Severity of a status."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True, kw_only=True)
class Status:
    """State of one component."""

    name: str  # "node: component".
    level: Level = Level.OK  # Severity.
    message: str = ""  # One sentence.
    values: Mapping[str, str] = field(default_factory=dict)  # What was measured, as text.


# Component of the orchestrator's status that carries the phase.
COMPONENT = "run"
STATUS = f"orchestrator: {COMPONENT}"
# Component whose status is an error for as long as a machine may move that was asked to stop.
MACHINE_COMPONENT = "machine"
MACHINE_STATUS = f"orchestrator: {MACHINE_COMPONENT}"
# Component whose values are the outcome of the run that is over; none while there is no such run.
OUTCOME_COMPONENT = "outcome"
# Node that plays a recording, and its status: position and length [s], and whether it is paused.
PLAYER = "bag_player"
PLAYBACK = f"{PLAYER}: playback"


# Value of a node's status, for as long as it cannot make this transition: the message has why.
REFUSED_TRANSITION = "cannot"


class RunPhase(Enum):
    """Of one run after the other; a simulated machine reports all but FAILED by itself."""

    READY = "ready"
    UNDER_WAY = "under way"
    OVER = "over"
    PREPARED = "being prepared"
    FAILED = "failed"
