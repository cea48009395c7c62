"""What the page can ask of the graph, and when."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from winding_core.cable.condition import Condition
from winding_core.lay.records import ControlMode
from winding_core.status import RunPhase

START, STOP, RESET, EMERGENCY_STOP = "start", "stop", "reset", "emergency_stop"
# Whatever the state of the machine as the page has it, these are offered and carried out.
STOPS = (STOP, EMERGENCY_STOP)
MACHINE = (START, STOP, RESET, EMERGENCY_STOP)
# What the controller of the lay is switched to.
LAY_CONTROL = {mode: f"lay_control_{mode.name.lower()}" for mode in ControlMode}
# How an answer names a command.
TITLES = {name: name.replace("_", " ") for name in MACHINE} | dict.fromkeys(
    LAY_CONTROL.values(), "lay control"
)
# What the machine refuses in which phase, so that the page can show it before a click.
_OUT_OF_PHASE = {
    (START, "winding"): "the machine is winding",
    (START, "finished"): "the run is finished; reset first",
    (START, "emergency stop"): "the emergency stop is latched; reset first",
    (RESET, "winding"): "stop the machine first",
    (RESET, "stopping"): "the machine is still stopping",
}
_BETWEEN_RUNS = {
    (START, RunPhase.FAILED): "the session cannot go on; begin another",
    (RESET, RunPhase.FAILED): "the session cannot go on; begin another",
    (START, RunPhase.PREPARED): "the next run is being prepared",
    (RESET, RunPhase.PREPARED): "the next run is being prepared",
    (START, RunPhase.OVER): "the run is over; reset makes the machine ready for the next",
}


class CommandError(RuntimeError):
    """The graph refused; the message is the sentence for the operator."""


@dataclass(frozen=True, kw_only=True)
class Choice:
    """What is wound, and whether the model follows what is found of it."""

    condition: Condition  # As every node takes it
    take_up: bool = False  # Whether the solver continues with the identified modulus


class Graph(Protocol):
    """The graph as the page commands it; what is refused or not answered is a CommandError."""

    def unavailable(self, command: str) -> str:
        """Return why a command cannot be given now; empty when it can."""

    async def command(self, command: str) -> str:
        """Give a command to the machine or to the controller of the lay; return its answer."""

    def unprepared(self) -> str:
        """Return why no other case can be chosen now; empty when it can."""

    async def choice(self) -> Choice:
        """Return what the solver is set to wind."""

    async def prepare(self, choice: Choice, report: Callable[[str], None]) -> str:
        """Set a choice on every node and bring all up; return what is worth knowing of it."""

    async def renew(self) -> str:
        """Let the watching nodes begin a new run; return a sentence if there was work left."""

    def unrecorded(self) -> str:
        """Return why the recording cannot be switched now; empty when it can."""

    async def record(self, on: bool) -> str:
        """Begin a recording or end it; return the recorder's answer."""

    async def play(self, *, position: float | None = None, paused: bool | None = None) -> str:
        """Go to a place of the recording that is played [s], or pause it or go on."""


def untimely(command: str, phase: str, run: RunPhase | None, *, moving: bool) -> str:
    """Return why a command makes no sense now; empty when it does.

    Args:
        command: To the machine.
        phase: That the machine reports; empty when it is not heard.
        run: How far the run is, as the orchestrator reports it; None where it reports none.
        moving: Whether the machine moves.
    """
    if command == RESET and run is RunPhase.UNDER_WAY and moving:
        return "stop the machine first"
    between = "" if run is None else _BETWEEN_RUNS.get((command, run), "")
    return _OUT_OF_PHASE.get((command, phase), "") or between
