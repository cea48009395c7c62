"""What the page can ask of the graph, and when."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from winding_core.cable.condition import Condition
from winding_core.lay.records import ControlMode
from winding_core.status import RunPhase

START, STOP, RESET, EMERGENCY_STOP = "start", "stop", "reset", "emergency_stop"
# Whatever the page believes of the machine, these are offered and carried out.
STOPS = (STOP, EMERGENCY_STOP)
# What the controller of the lay is switched to.
LAY_CONTROL = {
    ControlMode.OFF: "lay_control_off",
    ControlMode.WATCH: "lay_control_watch",
    ControlMode.DRIVE: "lay_control_drive",
}
# What the machine refuses in which phase, so that the page can show it before a click.
_OUT_OF_PHASE = {
    (START, "winding"): "the machine is winding",
    (START, "finished"): "the run is finished; reset first",
    (START, "emergency stop"): "the emergency stop is latched; reset first",
    (RESET, "winding"): "stop the machine first",
    (RESET, "stopping"): "the machine is still stopping",
}


class CommandError(RuntimeError):
    """The graph refused; the message is the sentence for the operator."""


@dataclass(frozen=True, kw_only=True)
class Choice:
    """What is wound, and whether the model follows what is found of it."""

    condition: Condition  # As every node takes it
    take_up: bool = False  # Whether the solver continues with the identified modulus


class Graph(Protocol):
    """The graph as the page commands it."""

    def unavailable(self, command: str) -> str:
        """Return why a command cannot be given now; empty when it can."""

    async def command(self, command: str) -> str:
        """Give a command to the machine or to the controller of the lay; return its answer.

        Raises:
            CommandError: It was refused or not answered.
        """

    def unprepared(self) -> str:
        """Return why no other case can be chosen now; empty when it can."""

    async def choice(self) -> Choice:
        """Return what the nodes are set to."""

    async def prepare(self, choice: Choice, report: Callable[[str], None]) -> str:
        """Set a choice on every node and bring all nodes up; raise CommandError.

        Returns:
            What the operator should know of it, or nothing.
        """

    async def renew(self) -> str:
        """Let the watching nodes begin a new run; raise CommandError.

        Returns:
            The sentence for the operator; empty where there was nothing left to do.
        """

    def unrecorded(self) -> str:
        """Return why the recording cannot be switched now; empty when it can."""

    async def record(self, on: bool) -> str:
        """Begin a recording or end it; return the recorder's answer.

        Raises:
            CommandError: It was refused or not answered.
        """


def between_runs(command: str, phase: RunPhase | None, *, moving: bool) -> str:
    """Return why a command does not fit how far a run is; empty when it does.

    Args:
        command: To the machine.
        phase: As the orchestrator reports it; None where it reports none.
        moving: Whether the machine moves.
    """
    if phase is RunPhase.FAILED and command in (START, RESET):
        return "the session cannot go on; begin another"
    if phase is RunPhase.PREPARED and command in (START, RESET):
        return "the next run is being prepared"
    if phase is RunPhase.OVER and command == START:
        return "the run is over; reset makes the machine ready for the next"
    if phase is RunPhase.UNDER_WAY and command == RESET and moving:
        return "stop the machine first"
    return ""


def out_of_phase(command: str, phase: str) -> str:
    """Return why a command makes no sense in the machine's phase; empty when it does.

    Stop and emergency stop are never held back: the page's state may be old.
    """
    return _OUT_OF_PHASE.get((command, phase), "")
