"""Machine, markers, lay and solver in; what is commanded of guide and brake out."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

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
from winding_ros.runtime.message_handler import Answer
from winding_ros.topic import Topic

# A machine that has stood for longer is not commanded: it may have been stopped [s].
_STANDING = 0.2
# A stamp of zero means that a command holds from its arrival [s].
_FIRST_STAMP = 1.0e-9


class LayControlHandler:
    """Follows the machine and answers where guide and brake have to be.

    Args:
        wanted: The controller and its program.

    Attributes:
        controller: Of the present run.
        newest: Last setpoint; None before the first joint state.
    """

    def __init__(self, wanted: LayControlParameters) -> None:
        self._wanted = wanted
        self._axes = wanted
        self._period = 1.0 / (topics.LAY_CONTROL_STATE.rate or 1.0)
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
        setpoint = self.newest = self.controller.advance(t, reading, self._pull)
        yield Answer(
            topic=topics.LAY_CONTROL_STATE,
            message=encode_cloud(t, _record(setpoint, self.controller.mode)),
        )
        beginning = t - self._start < _STANDING
        if not setpoint.commanding or (t - self._moved > _STANDING and not beginning):
            return
        scale = self._axes.carriage_scale
        target = AxisTarget(
            position=setpoint.guide / scale + self._axes.carriage_offset,
            speed=setpoint.guide_speed / scale,
        )
        stamp = max(t, _FIRST_STAMP)
        targets = encode_targets(JointTargets(t=stamp, axes={CARRIAGE: target}))
        targets.name = [self._axes.carriage_joint]
        yield Answer(topic=topics.JOINT_TARGETS, message=targets)
        if setpoint.pull is not None:
            command = TensionCommand(t=stamp, force=setpoint.pull)
            yield Answer(topic=topics.TENSION_COMMAND, message=encode_tension_command(command))


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
