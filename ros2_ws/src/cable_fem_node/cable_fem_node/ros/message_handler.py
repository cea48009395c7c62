"""Joint states and tension in; markers, cable and the prediction of the run out."""

import copy
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.ros.parameters import FemParameters
from cable_fem_node.winding.expected_cost import falling_behind
from cable_fem_node.winding.run_ahead import FIRST_STEPS, RunAhead, replay
from cable_fem_node.winding.winding_model import WindingModel
from winding_core.machine.incoming_readings import (
    LoadedReading,
    MotionStart,
    ReadingLimits,
    TensionPairing,
)
from winding_core.machine.readings import AxisReading
from winding_core.markers import CABLE_DTYPE, Markers
from winding_core.run_inputs import RunHistory, RunInputs
from winding_ros import topics
from winding_ros.messages.clouds import encode_cloud, encode_line_strip
from winding_ros.messages.rig import JointStateReader, decode_tension
from winding_ros.messages.serialised import MessageError
from winding_ros.runtime.message_handler import Answer
from winding_ros.topic import Topic

# Wound turns in every fem/cable. Cable that lies still is repeated for so long that a subscriber
# that misses some messages has it nevertheless, and no message grows with what is wound.
_CABLE_TURNS = 12.0


class FemHandler:
    """Shadows the machine with the chosen element.

    Making it winds the first piece of the run ahead, or the beginning of that; `begin` yields what
    was found. It is the rod that is wound ahead, whatever the element.

    Args:
        wanted: What to wind.
        go_on: Called now and then while a run is predicted or replayed; raises to end that.
        ahead_elsewhere: Whether its owner winds `ahead` to its end; otherwise `begin` does.

    Attributes:
        config: The rod's model that every run begins with.
        drive: How the machine is to move.
        slowness: Why the solver may fall behind the machine; empty where it keeps up.
        ahead: The run as planned, wound ahead.
        model: The cable of this run; None before `begin`.
        history: The inputs of this run so far.
        following: Whether readings of the machine have arrived.
        replayed: How much of a run that was already going has been replayed [s]; None if the
            run begins with this node.
    """

    def __init__(
        self,
        wanted: FemParameters,
        go_on: Callable[[], None] = lambda: None,
        *,
        ahead_elsewhere: bool = False,
    ) -> None:
        self.config = wanted.winding_config()
        self._axes = wanted
        self._follow_tension = wanted.follow_tension
        self._pairing = self._new_pairing()
        run = wanted.in_step()
        self.drive = drive = run.drive
        self._limits = ReadingLimits(
            weight=self.config.case.weight,
            angular_speed=drive.angular_speed,
            feed_speed=max(drive.feed_speed, wanted.carriage_speed),
        )
        self._before: tuple[float, AxisReading] | None = None
        self._go_on = go_on
        self._ahead_elsewhere = ahead_elsewhere
        self.slowness = falling_behind(run, time.thread_time) if wanted.element == "rod" else ""
        self._unwound = run.model()
        self.ahead = RunAhead.of(wanted.ahead())
        self.ahead.wind_piece(self._going, FIRST_STEPS)
        self._replay = Path(wanted.replay) if wanted.replay else None
        self.replayed: float | None = None
        self.model: WindingModel | None = None
        self.history = RunHistory()
        self._start: float | None = None

    @property
    def following(self) -> bool:
        """Whether readings of the machine have arrived."""
        return self._start is not None

    def begin(self, t: float) -> Iterator[Answer]:
        """Begin a new run at a time [s]; yield its prediction as far as it is known."""
        self.model = copy.deepcopy(self._unwound)
        self.history = RunHistory()
        self._start = None
        self._pairing = self._new_pairing()
        self._before = None
        self._read = JointStateReader(self._axes)
        self._motion = self._new_motion()
        self._markers_due = self._cable_due = 0.0
        if self._replay is not None:
            self._catch_up(self.model, RunInputs.read(self._replay))
            # The run after this one begins with its own start.
            self._replay = None
        for markers in tuple(self.ahead.found):
            yield self.predicted(t, markers)
        if not self._ahead_elsewhere:
            for markers in self.ahead.wind_on(self._going):
                yield self.predicted(t, markers)

    def take(self, topic: Topic, data: bytes) -> Iterator[Answer]:
        """Take a joint state or a tension; yield what is due.

        Raises:
            MessageError: The message cannot be used.
        """
        if self.model is None:
            # Configured and not yet active: a machine that turns already is not followed.
            return
        if topic is topics.TENSION:
            t, force = decode_tension(data)
            _refuse(self._limits.against_tension(force))
            self._pairing.add_tension(t, max(force, 0.0))
        else:
            t, reading = self._read(data)
            _refuse(self._limits.against_motion(t, reading, self._before))
            self._before = (t, reading)
            self._pairing.add_reading(t, reading)
        for paired in self._pairing.ready():
            passed = self._motion.passed(paired)
            # What was held back until the motion is too old to be published.
            for held in passed[:-1]:
                self._pass_over(self.model, held)
            for newest in passed[-1:]:
                yield from self._follow(self.model, newest)

    def predicted(self, t: float, markers: Markers) -> Answer:
        """Return a prediction of the run's markers, made from what was known at a time [s]."""
        return Answer(topic=topics.FEM_PREDICTION, message=encode_cloud(t, markers))

    def go_on_with(self, model: WindingModel) -> None:
        """Let another model of the same run take over; what it has missed is replayed.

        Args:
            model: Wound along some of this run's history.
        """
        replay(self.history.inputs, model)
        self.model = model

    def _going(self) -> bool:
        self._go_on()
        return True

    def _new_motion(self) -> MotionStart[LoadedReading]:
        return MotionStart(awaited=self._axes.await_motion)

    def _new_pairing(self) -> TensionPairing:
        return TensionPairing(_period(topics.TENSION), listened=self._follow_tension)

    def _follow(self, model: WindingModel, loaded: LoadedReading) -> Iterator[Answer]:
        self._advance(model, loaded)
        t = loaded.t
        if t >= self._markers_due:
            self._markers_due += _due_period(topics.FEM_MARKERS)
            yield Answer(topic=topics.FEM_MARKERS, message=encode_cloud(t, model.markers()))
        if t >= self._cable_due:
            self._cable_due += _due_period(topics.FEM_CABLE)
            cable = _published(model.newest_cable(_CABLE_TURNS))
            yield Answer(topic=topics.FEM_CABLE, message=encode_cloud(t, cable))
            points = np.stack([cable["x"], cable["y"], cable["z"]], axis=1).astype(float)
            width = self.config.case.cable_diameter
            yield Answer(topic=topics.FEM_CABLE_LINE, message=encode_line_strip(t, points, width))

    def _advance(self, model: WindingModel, loaded: LoadedReading) -> None:
        t, reading = loaded.t, loaded.reading
        if self._start is None:
            self._start = t
            self._markers_due = self._cable_due = t
        if t - self._start > self.history.latest:
            self.history.record(t - self._start, reading, loaded.tension)
        model.advance_to(t - self._start, reading, loaded.tension)

    def _pass_over(self, model: WindingModel, loaded: LoadedReading) -> None:
        """Follow a reading of the past, of which nothing is published."""
        self._advance(model, loaded)
        while loaded.t >= self._markers_due:
            self._markers_due += _due_period(topics.FEM_MARKERS)
        while loaded.t >= self._cable_due:
            self._cable_due += _due_period(topics.FEM_CABLE)

    def _catch_up(self, model: WindingModel, inputs: RunInputs) -> None:
        """Wind what the machine has wound before this node was there; nothing is published."""
        for t, reading, tension in inputs:
            self._go_on()
            if self._limits.against_motion(t, reading, self._before):
                continue
            self._before = (t, reading)
            usable = tension is not None and not self._limits.against_tension(tension)
            followed = max(tension or 0.0, 0.0) if self._follow_tension and usable else None
            for loaded in self._motion.passed(
                LoadedReading(t=t, reading=reading, tension=followed)
            ):
                self._pass_over(model, loaded)
            if followed is not None:
                self._pairing.add_tension(t, followed)
        self.replayed = model.time


def _refuse(reason: str) -> None:
    if reason:
        raise MessageError(reason)


def _period(topic: Topic) -> float:
    assert topic.rate is not None
    return 1.0 / topic.rate


def _due_period(topic: Topic) -> float:
    # A little early, so that rounding never makes an instant late.
    return _period(topic) - 1.0e-9


def _published(cable: NDArray[np.void]) -> NDArray[np.void]:
    records = np.zeros(cable.shape, dtype=CABLE_DTYPE)
    for name in CABLE_DTYPE.names or ():
        records[name] = cable[name]
    return records
