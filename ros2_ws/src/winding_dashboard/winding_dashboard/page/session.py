"""What the operators of one page do: commands, preparation, recording, limits, and the answers.

All browsers share it, so that a page that is loaded anew shows what the others show.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from winding_core.lay.records import ControlMode
from winding_core.parameters import typed_values
from winding_core.run_options import OperatorLimits
from winding_core.units import MILLIMETRE
from winding_dashboard.page import commands
from winding_dashboard.page.commands import Choice, CommandError, Graph
from winding_dashboard.page.condition_form import filled_condition, form_values
from winding_dashboard.state.view_state import ViewState

TITLES = {
    commands.START: "Start",
    commands.STOP: "Stop",
    commands.RESET: "Reset",
    commands.EMERGENCY_STOP: "EMERGENCY STOP",
}
PLAYED = "a recording is played; there is no machine"
# Every node reports once a second: a page that has listened for longer knows the present [s].
_LISTENED = 1.5
# What the fields of the limits are called on the page, by option.
LIMIT_LABELS = {"error_limit_pct": "Error of a length, %", "lay_tolerance_mm": "Lay, mm"}


class OperatorSession:
    """Does what operators ask for, one sentence for each.

    Args:
        state: What is known of the run.
        graph: What is commanded.
        limits: Returns what counts as good.
        time_of_day: Returns the time as it stands before a sentence.
        keep: Takes limits that an operator has set.

    Attributes:
        answer: What came of the last request, with its time of day; empty before any.
        alarm: Whether that was a refusal.
        choice: What the solver is set to wind; None before it answered.
        preparing: What is being done while another run is prepared; empty otherwise.
        refused: Why the last preparation was refused; empty otherwise.
    """

    def __init__(
        self,
        state: ViewState,
        graph: Graph,
        limits: Callable[[], OperatorLimits],
        time_of_day: Callable[[], str],
        keep: Callable[[OperatorLimits], object],
    ) -> None:
        self._state, self._graph, self._time_of_day = state, graph, time_of_day
        self._limits, self._keep = limits, keep
        self.answer, self.alarm = "", False
        self.choice: Choice | None = None
        self.preparing = self.refused = ""
        self._recording = False

    async def command(self, name: str) -> None:
        """Give a command to the machine."""
        title = TITLES[name].lower()
        if not await self._do(title, self._graph.command(name)) or name != commands.RESET:
            return
        self._state.clear()
        with self._showing("the nodes begin a new run"):
            await self._do(title, self._graph.renew())

    async def switch(self, mode: ControlMode) -> None:
        """Switch the controller of the lay."""
        await self._do("lay control", self._graph.command(commands.LAY_CONTROL[mode]))

    async def record(self, *, on: bool) -> None:
        """Begin a recording or end it."""
        self._recording = True
        try:
            # What has been done stays true after the recording has ended.
            await self._do("recording", self._graph.record(on), "begun" if on else "")
        finally:
            self._recording = False

    async def prepare(self, form: Mapping[str, Any]) -> None:
        """Set another condition on every node.

        Args:
            form: What stands in the form: `case`, `law`, `take_up`, and `fields` by option; with
                `check` it is looked at only.
        """
        if reason := self.unprepared():
            self._answer(f"prepare: {reason}", alarm=True)
            return
        try:
            condition = filled_condition(
                int(form.get("case") or 0), str(form.get("law")), dict(form.get("fields") or {})
            )
        except (ValueError, TypeError) as error:
            self._refuse_preparation(error)
            return
        self.refused = ""
        if form.get("check"):
            self._answer("prepare: the form is complete; the present run will be dropped")
            return
        choice = Choice(condition=condition, take_up=bool(form.get("take_up")))
        # What comes from now on, the prediction among it, is of the run that is prepared.
        self._state.begin_anew()
        with self._showing("preparing"):
            try:
                remark = await self._graph.prepare(choice, self._show)
            except CommandError as error:
                self._refuse_preparation(error)
                return
        self.choice = choice
        case = condition.resolved().case
        name = f"case {case.number}" if case.number else "a condition of your own"
        self._answer(f"prepare: ready to wind {name}{f'; {remark}' if remark else ''}")

    def _refuse_preparation(self, error: Exception) -> None:
        self.refused = str(error)
        self._answer(f"prepare: {error}", alarm=True)

    def set_limits(self, typed: Mapping[str, Any]) -> None:
        """Take what counts as good: `error_limit_pct` [%] and `lay_tolerance_mm` [mm]."""
        empty = [LIMIT_LABELS.get(key, key) for key, value in typed.items() if value in (None, "")]
        if empty:
            self._answer(f"limits: {empty[0]} is empty; give a number", alarm=True)
            return
        try:
            found: dict[str, Any] = typed_values(OperatorLimits, typed, LIMIT_LABELS.__getitem__)
        except (ValueError, TypeError) as error:
            self._answer(f"limits: {error}", alarm=True)
            return
        self._keep(replace(self.limits, **found))
        self._answer(
            f"limits: {self.limits.error_limit_pct:g} % of a length, "
            f"{self.limits.lay_tolerance / MILLIMETRE:g} mm of the lay"
        )

    @property
    def limits(self) -> OperatorLimits:
        """What counts as good."""
        return self._limits()

    async def learn_choice(self) -> None:
        """Ask the solver what it is set to wind, until it answers."""
        if self.choice is not None or self.preparing or self._graph.unprepared():
            return
        try:
            self.choice = await self._graph.choice()
        except CommandError as error:
            self.refused = str(error)
        else:
            self.refused = ""

    def form(self) -> dict[str, Any]:
        """Return what stands in the form; empty before the solver has answered."""
        if self.choice is None:
            return {}
        condition = self.choice.condition
        return {
            "case": condition.case,
            "law": condition.law,
            "take_up": self.choice.take_up,
            "fields": form_values(condition),
        }

    def choosable(self) -> bool:
        """Return whether there is a condition to show and to change."""
        return not self._state.player and (self.choice is not None or not self._graph.unprepared())

    def unprepared(self) -> str:
        """Return why no other run can be prepared now; empty when one can."""
        missing = PLAYED if self._state.player else self._graph.unprepared()
        if missing:
            return f"cannot be chosen here: {missing}"
        if self.preparing:
            return "another run is being prepared"
        if self._state.going:
            return f"cannot be chosen while the machine is {self._state.phase}"
        if self.choice is None:
            return "asking the solver what it is set to"
        return ""

    def unrecorded(self) -> str:
        """Return why the recording cannot be switched now; empty when it can."""
        if self._state.player:
            return PLAYED
        return self._graph.unrecorded() or ("the recorder is at work" if self._recording else "")

    def unavailable(self, command: str, now: float) -> str:
        """Return why a command makes no sense at wall time now [s]; empty when it does."""
        state = self._state
        if state.player:
            return PLAYED
        if command in commands.STOPS:
            return ""
        phase = state.phase if state.heard(now) else ""
        reason = (
            self._graph.unavailable(command)
            or commands.out_of_phase(command, phase)
            or commands.between_runs(command, state.run_phase, moving=state.moving)
        )
        if command == commands.START:
            reason = reason or self._unready(now)
        return reason

    def _unready(self, now: float) -> str:
        """Return why nothing should be started at wall time now [s]; empty when it may."""
        state, health = self._state, self._state.health
        if self.preparing:
            return "another run is being prepared"
        if not state.heard(now):
            return "nothing is heard of the machine"
        if now - health.first_heard < _LISTENED:
            return "the page has just begun to listen"
        if down := next(iter(health.down(now).values()), ""):
            return f"{down}; wait for it, or prepare the run"
        unanswered = health.unanswered()
        return f"{unanswered} has not answered yet" if unanswered else ""

    def refuse(self, what: str, why: str) -> None:
        """Report that a request was not carried out."""
        self._answer(f"{what}: {why}", alarm=True)

    async def _do(self, what: str, work: Awaitable[str], done: str = "") -> bool:
        try:
            answer = await work
        except CommandError as error:
            self._answer(f"{what}: {error}", alarm=True)
            return False
        if done or answer:
            self._answer(f"{what}: {done or answer}")
        return True

    @contextmanager
    def _showing(self, what: str) -> Iterator[None]:
        """Show what the nodes are taken through."""
        self._show(what)
        try:
            yield
        finally:
            self._show("")

    def _show(self, what: str) -> None:
        self.preparing = what

    def _answer(self, sentence: str, *, alarm: bool = False) -> None:
        self.answer, self.alarm = f"{self._time_of_day()}  {sentence}", alarm
