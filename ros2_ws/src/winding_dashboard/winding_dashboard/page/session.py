"""What the operators of one page do: commands, preparation, recording, limits, and the answers.

All browsers share it, so that a page that is loaded anew shows what the others show.
"""

from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

from winding_core.cable.condition import Condition
from winding_core.parameters import typed_values
from winding_core.run_options import OperatorLimits
from winding_core.run_spec import SECTION_OF
from winding_core.units import MILLIMETRE
from winding_dashboard.page import commands
from winding_dashboard.page.commands import Choice, CommandError, Graph
from winding_dashboard.page.condition_form import form_values, label, typed_options
from winding_dashboard.page.recipes import Recipes
from winding_dashboard.state.view_state import ViewState

PLAYED = "a recording is played; there is no machine"
# Every node reports once a second: a page that has listened for longer knows the present [s].
_LISTENED = 1.5
# What the fields of the limits are called on the page, by option.
LIMIT_LABELS = {"error_limit_pct": "Error of a length, %", "lay_tolerance_mm": "Lay, mm"}


@dataclass(eq=False)
class OperatorSession:
    """Does what operators ask for, one sentence for each."""

    state: ViewState  # What is known of the run
    graph: Graph  # What is commanded
    recipes: Recipes  # Conditions that are kept
    limits: Callable[[], OperatorLimits]  # Returns what counts as good
    time_of_day: Callable[[], str]  # Returns the time as it stands before a sentence
    keep: Callable[[OperatorLimits], object]  # Takes limits that an operator has set

    def __post_init__(self) -> None:
        self.answer = ""  # What came of the last request, with its time of day
        self.alarm = False  # Whether that was a refusal
        self.choice: Choice | None = None  # What the solver is set to; None before it answered
        self.preparing = ""  # What the nodes are taken through now
        self.loaded: dict[str, Any] = {}  # What a recipe puts into the form
        self.refused = ""  # Why the last preparation was refused
        self._recording = False

    async def ask(self, what: str, work: Awaitable[str]) -> None:
        """Carry out a request; its sentence, or the reason of a refusal, is the answer."""
        try:
            answer = await work
        except (CommandError, ValueError) as error:
            self.refuse(what, str(error))
        else:
            # What has been done stays true where there is no sentence of its own.
            self._answer(f"{what}: {answer or 'done'}")

    async def command(self, name: str) -> str:
        """Give a command to the machine or to the controller of the lay."""
        answer = await self.graph.command(name)
        if name != commands.RESET:
            return answer
        self.state.clear()
        with self._preparing("the nodes begin a new run"):
            return await self.graph.renew() or answer

    async def record(self, *, on: bool) -> str:
        """Begin a recording or end it."""
        self._recording = True
        try:
            answer = await self.graph.record(on)
        finally:
            self._recording = False
        return "begun" if on else answer

    async def play(self, asked: Mapping[str, Any]) -> str:
        """Go to `position` [s] of a recording that is played, or switch `paused`.

        Raises:
            ValueError: It is asked for neither.
        """
        position, paused = asked.get("position"), asked.get("paused")
        if isinstance(position, int | float):
            return await self.graph.play(position=float(position))
        if isinstance(paused, bool):
            return await self.graph.play(paused=paused)
        raise ValueError("give a position in seconds, or whether it is paused")

    async def prepare(self, form: Mapping[str, Any]) -> str:
        """Set another condition on every node.

        Args:
            form: What stands in the form: `case`, `law`, `take_up`, and `fields` by option; with
                `check` it is looked at only.

        Raises:
            CommandError: That cannot be done now, or a node refused.
            ValueError: What is typed is refused.
        """
        if reason := self.unprepared():
            raise CommandError(reason)
        try:
            condition = Condition.from_typed(typed_options(form), spelling=label)
            self.refused = ""
            if form.get("check"):
                return "the form is complete; the present run will be dropped"
            choice = Choice(condition=condition, take_up=bool(form.get("take_up")))
            # What comes from now on, the prediction among it, is of the run that is prepared.
            self.state.begin_anew()
            with self._preparing("preparing"):
                remark = await self.graph.prepare(choice, self._show)
        except (ValueError, CommandError) as error:
            self.refused = str(error)
            raise
        self.choice = choice
        case = condition.resolved().case
        name = f"case {case.number}" if case.number else "an own condition"
        return f"ready to wind {name}{f'; {remark}' if remark else ''}"

    async def save_recipe(self, name: str, form: Mapping[str, Any]) -> str:
        """Keep what stands in the form as a cell file."""
        self.recipes.save(name, typed_options(form))
        return f"{name} is kept"

    async def load_recipe(self, name: str) -> str:
        """Put a kept recipe into the form of the browser that asks, as `loaded`."""
        spec = self.recipes.load(name)
        self.loaded = _form(spec.condition)
        left = [key for key in spec.given if SECTION_OF[key] != "condition"]
        remark = f"; not {', '.join(left)}, which the run has already" if left else ""
        return f"{name} stands in the form{remark}"

    async def set_limits(self, typed: Mapping[str, Any]) -> str:
        """Take what counts as good: `error_limit_pct` [%] and `lay_tolerance_mm` [mm].

        Raises:
            ValueError: One of them is refused.
        """
        for key, value in typed.items():
            if value in (None, ""):
                raise ValueError(f"{LIMIT_LABELS.get(key, key)} is empty; give a number")
        found: dict[str, Any] = typed_values(
            OperatorLimits, typed, lambda key: LIMIT_LABELS.get(key, key)
        )
        self.keep(replace(self.limits(), **found))
        limits = self.limits()
        return (
            f"{limits.error_limit_pct:g} % of a length, "
            f"{limits.lay_tolerance / MILLIMETRE:g} mm of the lay"
        )

    async def learn_choice(self) -> None:
        """Ask the solver what it is set to wind, until it answers."""
        if self.choice is not None or self.preparing or self.graph.unprepared():
            return
        try:
            self.choice = await self.graph.choice()
        except CommandError as error:
            self.refused = str(error)
        else:
            self.refused = ""

    def form(self) -> dict[str, Any]:
        """Return what stands in the form; empty before the solver has answered."""
        if self.choice is None:
            return {}
        return {**_form(self.choice.condition), "take_up": self.choice.take_up}

    def choosable(self) -> bool:
        """Return whether there is a condition to show and to change."""
        return not self.state.player and (self.choice is not None or not self.graph.unprepared())

    def unprepared(self) -> str:
        """Return why no other run can be prepared now; empty when one can."""
        missing = PLAYED if self.state.player else self.graph.unprepared()
        if missing:
            return f"cannot be chosen here: {missing}"
        if self.preparing:
            return "another run is being prepared"
        if self.state.going:
            return f"cannot be chosen while the machine is {self.state.phase}"
        return "" if self.choice is not None else "asking the solver what it is set to"

    def unrecorded(self) -> str:
        """Return why the recording cannot be switched now; empty when it can."""
        if self.state.player:
            return PLAYED
        return self.graph.unrecorded() or ("the recorder is at work" if self._recording else "")

    def unavailable(self, command: str, now: float) -> str:
        """Return why a command makes no sense at wall time now [s]; empty when it does."""
        state = self.state
        if state.player:
            return PLAYED
        if command in commands.STOPS:
            return ""
        reason = self.graph.unavailable(command) or commands.untimely(
            command, state.phase if state.heard(now) else "", state.run_phase, moving=state.moving
        )
        return reason or (self._unready(now) if command == commands.START else "")

    def _unready(self, now: float) -> str:
        """Return why nothing should be started at wall time now [s]; empty when it may."""
        state, health = self.state, self.state.health
        if self.preparing:
            return "another run is being prepared"
        if not state.heard(now):
            return "no data from the machine"
        if now - health.first_heard < _LISTENED:
            return "the page has just begun to listen"
        if down := next(iter(health.down(now).values()), ""):
            return f"{down}; wait for it, or prepare the run"
        unanswered = health.unanswered()
        return f"{unanswered} has not answered yet" if unanswered else ""

    def refuse(self, what: str, why: str) -> None:
        """Report that a request was not carried out."""
        self._answer(f"{what}: {why}", alarm=True)

    @contextmanager
    def _preparing(self, what: str) -> Iterator[None]:
        """Show what the nodes are taken through."""
        self._show(what)
        try:
            yield
        finally:
            self._show("")

    def _show(self, what: str) -> None:
        self.preparing = what

    def _answer(self, sentence: str, *, alarm: bool = False) -> None:
        self.answer, self.alarm = f"{self.time_of_day()}  {sentence}", alarm


def _form(condition: Condition) -> dict[str, Any]:
    return {"case": condition.case, "law": condition.law, "fields": form_values(condition)}
