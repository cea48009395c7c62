"""Machine, markers, lay and solver in; what is commanded of guide and brake out."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lay_control_node.control.cadence import LONGEST_GAP, Cadence
from lay_control_node.control.lay_controller import LayController, Setpoint
from lay_control_node.ros.parameters import LayControlParameters
from winding_core.lay.records import LAY_CONTROL_DTYPE, LAY_DTYPE, ControlMode, LayControlRecords
from winding_core.machine.commands import CARRIAGE, AxisTarget, JointTargets, TensionCommand
from winding_core.machine.incoming_readings import stands
from winding_core.machine.readings import AxisReading
from winding_core.markers import MARKER_DTYPE
from winding_ros import topics
from winding_ros.messages.clouds import decode_cloud, encode_cloud
from winding_ros.messages.commands import encode_targets, encode_tension_command
from winding_ros.messages.rig import JointStateReader, decode_tension
from winding_ros.messages.serialised import MessageError
from winding_ros.runtime.message_handler import Answer
from winding_ros.topic import Topic

# A machine that has stood for longer is not commanded: it may have been stopped [s].
_STANDING = 0.2
_FIRST_STAMP = 1.0e-9  # A stamp of zero means that a command holds from its arrival [s]
# A command without a successor for so many periods is carried on, for so long at most [s]; a
# machine that is silent for twice as long is stopped by supervision.
_CARRIED_AFTER = 2.0
_CARRIED_FOR = 1.0


@dataclass(frozen=True, kw_only=True)
class Clocks:
    """Time as a real machine's commands are counted by; each with an origin of its own."""

    now: Callable[[], float]  # Monotonic time [s]
    arrived: Callable[[], float]  # When the message that is being taken arrived [s]


class _Planned(NamedTuple):
    """A command of the carriage as it was planned."""

    now: float  # When it left, by the clock [s]
    t: float  # Its stamp [s]
    guide: float  # Place of the carriage [m]
    speed: float  # Its rate [m/s]
    programme: float  # Rate at which the drive programme advances it [m/s]


class LayControlHandler:
    """Follows the machine and answers where guide and brake have to be.

    Args:
        wanted: The controller and its program.
        clocks: By which a real machine waits for commands; None for a machine that waits for its
            readers, whose time is its readings'.

    Attributes:
        controller: Of the present run.
        newest: Last setpoint; None before the first joint state.
        cadence: How far apart commands have left.
    """

    def __init__(self, wanted: LayControlParameters, clocks: Clocks | None = None) -> None:
        self._wanted = wanted
        self._clocks = clocks
        self._axes = wanted
        self._period = 1.0 / (topics.LAY_CONTROL_STATE.rate or 1.0)
        # A first setpoint loads what plans it, up to a second of work: before time runs.
        rest = AxisReading(
            cylinder_angle=0.0, angular_speed=0.0, carriage_position=0.0, feed_speed=0.0
        )
        controller = wanted.new_controller()
        controller.mode = ControlMode.DRIVE
        controller.advance(0.0, rest, wanted.resolved().case.weight)
        # Messages of a machine may arrive before the first run begins.
        self._restart(wanted.new_controller())

    def begin(self, t: float) -> Iterator[Answer]:
        """Begin a new run at a time [s]; the mode stays as it was switched."""
        mode = self.controller.mode
        self._restart(self._wanted.new_controller())
        self.controller.mode = mode
        yield from ()

    def _restart(self, controller: LayController) -> None:
        self.controller = controller
        self.newest: Setpoint | None = None
        self._read = JointStateReader(self._axes)
        self._pull = self._wanted.resolved().case.weight
        self._start: float | None = None
        self._due = -math.inf
        self._moved = -math.inf
        self.cadence = Cadence()
        self._planned: _Planned | None = None
        self._carried_to, self._carried_guide = -math.inf, 0.0

    def switch(self, mode: ControlMode) -> None:
        """Do something else with what is found from now on."""
        self.controller.mode = mode

    def take(self, topic: Topic, data: bytes) -> Iterator[Answer]:
        """Take a message; yield what is commanded with every joint state that is due.

        Raises:
            MessageError: The message cannot be used.
        """
        if topic is topics.JOINT_STATES:
            t, reading = self._read(data)
            if reading.guide is not None:
                try:
                    reading.guide.free_length(self._wanted.resolved().case.centreline_radius)
                except ValueError as error:
                    raise MessageError(str(error)) from None
            self.cadence.read(t if self._clocks is None else self._clocks.arrived())
            if t >= self._due:
                self._due = max(self._due, t) + self._period - 1.0e-9
                yield from self._command(t, reading)
        elif topic is topics.TENSION:
            _, force = decode_tension(data)
            self._pull = max(force, 0.0)
        elif topic is topics.TRACKED_MARKERS:
            _, markers = decode_cloud(data, MARKER_DTYPE)
            self.controller.take_markers(markers)
        elif topic is topics.TRACKED_LAY:
            _, places = decode_cloud(data, LAY_DTYPE)
            self.controller.take_lay(places)
        elif topic is topics.FEM_MARKERS:
            t, _ = decode_cloud(data, MARKER_DTYPE)
            self.controller.take_solver(t)

    def _command(self, t: float, reading: AxisReading) -> Iterator[Answer]:
        if self._start is None:
            self._start = t
            self.controller.take_solver(t)
        if not stands(reading):
            self._moved = t
        now = t if self._clocks is None else self._clocks.now()
        self.controller.late = self.cadence.late(now)
        setpoint = self.newest = self.controller.advance(t, reading, self._pull)
        yield Answer(
            topic=topics.LAY_CONTROL_STATE,
            message=encode_cloud(t, _record(setpoint, self.controller.mode)),
        )
        # A real machine takes commands only once it was started.
        beginning = t - self._start < _STANDING and not self._axes.await_motion
        if not setpoint.commanding or (t - self._moved > _STANDING and not beginning):
            self._planned = None
            self.cadence.rest()
            return
        self.cadence.plan(now)
        stamp = max(t, _FIRST_STAMP)
        # A machine refuses what is older than the command before it.
        if stamp > self._carried_to:
            programme = self.controller.config.advance_per_radian * reading.angular_speed
            self._planned = _Planned(now, stamp, setpoint.guide, setpoint.guide_speed, programme)
            yield self._targets(now, stamp, setpoint.guide, setpoint.guide_speed)
        else:
            # A machine in arrears comes to what it was commanded meanwhile, and never goes back.
            yield self._targets(now, self._carried_to, self._carried_guide, 0.0)
        if setpoint.pull is not None:
            command = TensionCommand(t=stamp, force=setpoint.pull)
            yield Answer(topic=topics.TENSION_COMMAND, message=encode_tension_command(command))

    def carried(self, now: float) -> Iterator[Answer]:
        """Yield the newest command, carried on, where no other has left for two periods.

        It goes on at its own rate for as long as a gap may be, then at the drive programme's for a
        second: what stays away for longer is for the machine to deal with.
        """
        planned = self._planned
        if planned is None or self.cadence.since(now) < _CARRIED_AFTER * self._period:
            return
        ahead = now - planned.now
        if ahead > _CARRIED_FOR:
            return
        low, high = self._wanted.guide_travel
        own = min(ahead, LONGEST_GAP)
        guide = planned.guide + planned.speed * own + planned.programme * (ahead - own)
        within = min(max(guide, low), high)
        self._carried_to, self._carried_guide = planned.t + ahead, within
        speed = planned.speed if own == ahead else planned.programme
        speed = speed if within == guide else 0.0
        yield self._targets(now, self._carried_to, within, speed)

    def _targets(self, now: float, t: float, guide: float, speed: float) -> Answer:
        """Return a command stamped t [s] in the joint's own unit; it leaves now [s]."""
        self.cadence.send(now)
        scale = self._axes.carriage_scale
        target = AxisTarget(
            position=guide / scale + self._axes.carriage_offset, speed=speed / scale
        )
        targets = encode_targets(JointTargets(t=t, axes={CARRIAGE: target}))
        targets.name = [self._axes.carriage_joint]
        return Answer(topic=topics.JOINT_TARGETS, message=targets)


def _record(setpoint: Setpoint, mode: ControlMode) -> LayControlRecords:
    lay, stretch = setpoint.lay, setpoint.stretch
    record = np.zeros(1, dtype=LAY_CONTROL_DTYPE)
    values = {
        "z": lay.z,
        "mode": int(mode),
        "theta": setpoint.theta,
        "wanted_z": setpoint.wanted_z,
        "sigma_z": lay.sigma_z,
        "guide": setpoint.guide,
        "guide_speed": setpoint.guide_speed,
        "pull": math.nan if setpoint.pull is None else setpoint.pull,
        "free_length": lay.free_length,
        "sigma_free_length": lay.sigma_length,
        "load_share": stretch.share,
        "sigma_load_share": math.sqrt(float(stretch.covariance[0, 0])),
        "basis": int(setpoint.basis),
        "limited": int(setpoint.limited),
    }
    for name, value in values.items():
        record[name] = value
    return record
