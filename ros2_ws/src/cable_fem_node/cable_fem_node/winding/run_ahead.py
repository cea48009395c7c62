"""A model taken along inputs: a run replayed, and a run wound ahead piece by piece."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import KW_ONLY, dataclass

from cable_fem_node.winding.prediction import PlannedRun
from cable_fem_node.winding.winding_model import WindingModel
from winding_core.machine.readings import AxisReading
from winding_core.markers import Markers, is_wound
from winding_core.run_inputs import Inputs, RunInputs

# Simulated time of a piece [s]: as long as the paper's runs, whose prediction is one piece.
PIECE = 20.0
# Elements times steps after which a first piece is left for later: two processor seconds.
FIRST_STEPS = 5.0e7
Planned = Iterable[tuple[float, AxisReading, float | None]]


class AbandonedError(RuntimeError):
    """A replay was no longer wanted."""


def replay(inputs: Inputs, model: WindingModel, going: Callable[[], bool] = lambda: True) -> None:
    """Advance a model from its own time along inputs, shape (n,) of INPUT_DTYPE.

    Args:
        inputs: Ascending in time.
        model: What is advanced.
        going: Returns whether the result is still wanted; called before every step.

    Raises:
        AbandonedError: `going` returned False.
    """
    for t, reading, tension in RunInputs(samples=inputs[inputs["t"] > model.time]):
        if not going():
            raise AbandonedError(f"the replay was abandoned at t = {model.time:.6g} s")
        model.advance_to(t, reading, tension)


@dataclass(eq=False)
class RunAhead:
    """Winds a cable along planned inputs, and keeps what it finds at the ends of pieces.

    What is found depends on the plan alone, not on when or in how many calls it is wound.
    """

    # Begins where the plan does, then as far as it is wound; nothing else may advance it
    model: WindingModel
    planned: Planned  # (t [s], reading, tension [N] or None), ascending in time
    # Called with the model at the end of every piece; raises to refuse
    check: Callable[[WindingModel], None] = lambda _model: None
    _: KW_ONLY
    piece: float = PIECE  # Simulated time of a piece [s]

    def __post_init__(self) -> None:
        self.done = False  # Whether the plan is wound to its end
        # Records of P0..Pn: one whenever further markers have been wound by the end of a piece, and
        # the last at the end of the plan.
        self.found: list[Markers] = []
        self._planned = iter(self.planned)
        self._step = next(self._planned, None)
        self._wound = 1
        self._end = self.model.time + self.piece

    @classmethod
    def of(cls, run: PlannedRun, *, piece: float = PIECE) -> RunAhead:
        """Return a run that is to be wound as planned, from its start."""
        times = run.frame_times()[1:].tolist()
        planned = ((t, run.drive.reading_at(t), None) for t in times)
        return cls(run.model(), planned, run.refuse_wrong, piece=piece)

    def wind_piece(
        self, going: Callable[[], bool] = lambda: True, most_steps: float = float("inf")
    ) -> Markers | None:
        """Wind to the end of the piece that is begun.

        Args:
            going: Returns whether to go on; called before every step, what it raises goes through.
            most_steps: Count of elements times steps after which the rest of the piece is left to a
                further call.

        Returns:
            What has been added to `found`; None if nothing has.

        Raises:
            AbandonedError: `going` returned False; a further call goes on from there.
            SolverError: The run cannot be wound, or its result is invalid; names time and cause.
        """
        limit = self.model.element_steps + most_steps
        while self.model.time < self._end and self.model.element_steps < limit:
            if not going():
                raise AbandonedError(f"given up at t = {self.model.time:.6g} s")
            if self._step is not None:
                self.model.advance_to(*self._step)
                self._step = next(self._planned, None)
            if self._step is None:
                self.done = True
                break
        self.check(self.model)
        if self.model.time >= self._end:
            self._end += self.piece
        elif not self.done:
            return None
        return self._find()

    def wind_on(self, going: Callable[[], bool] = lambda: True) -> Iterator[Markers]:
        """Wind to the end of the plan; yield what is added to `found`, as `wind_piece`."""
        while not self.done:
            found = self.wind_piece(going)
            if found is not None:
                yield found

    def _find(self) -> Markers | None:
        markers = self.model.markers()
        wound = int(is_wound(markers).sum())
        if wound == self._wound and not self.done:
            return None
        self._wound = wound
        self.found.append(markers)
        return markers
