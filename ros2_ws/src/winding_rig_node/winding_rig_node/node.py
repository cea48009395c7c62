"""ROS adapter of the rig: sensors and clock out, start and stop in."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from winding_core.cable.cases import Case
from winding_core.parameters import refuse_unknown
from winding_core.status import Status
from winding_rig_node.camera.shown_lay import GrowingLay, KnownLay, ShownLay
from winding_rig_node.lay.known_lay import CableLay
from winding_rig_node.lay.lay_law import MotionLay, motion_lay
from winding_rig_node.lay.truth import truth_path, truth_record, write_truth
from winding_rig_node.machine.arm_guide import ArmGuide
from winding_rig_node.machine.faults import Faults
from winding_rig_node.machine.machine import Machine
from winding_rig_node.machine.machine_config import MachineConfig, PhaseError, cylinder_axis
from winding_rig_node.machine.pace import Pace
from winding_rig_node.ros.camera import Camera, FrameListener
from winding_rig_node.ros.inputs import enabled_faults, follow_fault_parameters, take_commands
from winding_rig_node.ros.machine_loop import MachineLoop
from winding_rig_node.ros.outputs import Outputs, rig_status
from winding_rig_node.ros.parameters import RigParameters
from winding_ros import graph, services, topics
from winding_ros.messages.serialised import MessageError
from winding_ros.messages.stamps import serialised_stamp_ns
from winding_ros.runtime.heartbeat import hear_heartbeat
from winding_ros.runtime.managed_node import ManagedNode
from winding_ros.topic import Topic


class RigNode(ManagedNode[RigParameters]):
    """Simulated winding machine; owns simulated time.

    Publishes and serves what `winding graph --interfaces` lists. Subscribes to commands for its
    axes and brake, to `pace_topics` for their stamps alone, and to the orchestrator's signs of
    life.

    The machine runs in a thread of its own with absolute deadlines, the camera in another; the
    executor only serves requests and answers.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(graph.RIG, RigParameters, **kwargs)
        self._camera: Camera | None = None
        self._loop: MachineLoop | None = None
        self._lay: CableLay | MotionLay
        self._truth: Path | None = None
        for service, act in (
            (services.START, self._start),
            (services.STOP, lambda loop: loop.command(Machine.stop)),
            (services.QUICK_STOP, lambda loop: loop.command(Machine.quick_stop)),
            (services.RESET, lambda loop: loop.command(loop.reset)),
            (services.EMERGENCY_STOP, lambda loop: loop.command(Machine.emergency_stop)),
        ):
            service.serve(self, self._command(act))
        services.SET_CAMERA_INFO.serve(self, self._set_camera_info)
        # When set, takes every frame in this process, from the camera's thread, and
        # camera/image_raw falls silent; the preview goes on.
        self.frame_listener: FrameListener | None = None
        follow_fault_parameters(self, self._put_in)
        hear_heartbeat(self, topics.ORCHESTRATOR, self._note_supervisor)

    def configure(self) -> None:
        """Build machine, lay and camera, unless that runs elsewhere; advertise everything."""
        wanted = self.configuration
        what = wanted.resolved()
        case, drive = what.case, what.drive
        rng = np.random.default_rng(wanted.seed)
        path = wanted.arm_path()
        driven, shown = self._wind(case, rng)
        self._outputs = Outputs(self)
        self._camera = None if wanted.camera_elsewhere else Camera(wanted, shown, self._outputs)
        self._loop = MachineLoop(
            wanted,
            Machine(
                MachineConfig(
                    case=case,
                    drive=drive,
                    duration=wanted.duration,
                    cylinder=cylinder_axis(case),
                    arm=None if path is None else ArmGuide(path),
                    commands=wanted.command_limits(path),
                ),
                rng,
            ),
            Pace(self._paced(), wanted.max_lead),
            self._outputs,
            self._camera,
            driven,
            finished=self._write_truth,
            warn=self.get_logger().error,
            fail=self.fail,
        )
        self._put_in(
            enabled_faults(
                wanted.inject_fault,
                enabled=wanted.inject_faults,
                seed=wanted.seed,
                camera_elsewhere=wanted.camera_elsewhere,
            )
        )
        take_commands(self, self._loop)
        for topic in topics.TOPICS:
            if topic.name in self._loop.pace.answered:
                self.endpoints.subscribe(topic, self._answer(self._loop, topic.name), raw=True)

    def activate(self) -> None:
        """Start the machine's and the camera's threads; time waits for rig/start."""
        assert self._loop is not None
        if self._camera is not None:
            self._camera.listener = self.frame_listener
        self._loop.begin()

    def deactivate(self) -> None:
        """Bring the axes to rest and stop both threads."""
        if self._loop is not None:
            self._loop.end()
            self._write_truth()

    def cleanup(self) -> None:
        """Forget the machine and its camera."""
        self._loop = self._camera = None

    def advertised(self) -> Iterable[Topic]:
        """Return what the node publishes; a camera elsewhere publishes its frames itself."""
        shown = () if self.configuration.camera_elsewhere else graph.CAMERA_TOPICS
        return (t for t in graph.RIG.publishes if t in shown or t not in graph.CAMERA_TOPICS)

    def status(self) -> Status:
        """Return the machine's phase and time."""
        if self._loop is None:
            return Status(name=topics.RIG, message="not configured")
        faults = str(self.get_parameter("inject_fault").value)
        return rig_status(
            self._loop.machine,
            self._loop.pace,
            faults,
            "" if self.configuration.follows_commands else self.configuration.lay,
        )

    def come_to_rest(self) -> None:
        """Stop both axes, and wait until they stand."""
        if self._loop is not None:
            self._loop.come_to_rest()

    def contested(self, sentence: str) -> None:
        """Stop the machine: another node publishes in its name."""
        if self._loop is not None:
            self._loop.stop_quickly(sentence)

    def _wind(self, case: Case, rng: np.random.Generator) -> tuple[MotionLay | None, ShownLay]:
        """Return the lay that the machine makes, None for one known ahead, and what is shown."""
        wanted = self.configuration
        self._truth = truth_path(wanted.truth_file)
        if not wanted.follows_commands:
            self._lay = wanted.laid(rng)
            return None, KnownLay(self._lay, wanted.free_length)
        drum = wanted.drum(case)
        self._lay = driven = motion_lay(wanted.lay, case, rng, drum)
        # The first step compiles its kernel: before time runs, not within it.
        driven.advance(0.0, 0.0, case.weight)
        driven.restart()
        return driven, GrowingLay(driven.view(), lifted=drum is not None)

    def _write_truth(self) -> None:
        if self._truth is None or self._loop is None:
            return
        try:
            turned = self._loop.machine.state.cylinder.motor.position
            write_truth(self._truth, truth_record(self._lay.truth(turned)))
        except OSError as error:
            self.get_logger().error(f"cannot write the truth of the run: {error}")

    def _start(self, loop: MachineLoop) -> None:
        if self.endpoints.rivals():
            raise PhaseError(f"cannot start while {self.endpoints.rivals()[0]}")
        loop.command(loop.start)

    def _note_supervisor(self) -> None:
        if self._loop is not None:
            self._loop.hear_supervisor()

    def _put_in(self, faults: Faults) -> None:
        if self._loop is None:
            return
        self._loop.machine.faults = self._outputs.faults = faults
        if self._camera is not None:
            self._camera.faults = faults

    def _command(self, act: Callable[[MachineLoop], None]) -> Callable[[Any, Any], Any]:
        def serve(_request: Any, response: Any) -> Any:
            if self._loop is None or not self._loop.running:
                response.message = f"{topics.RIG} is not active"
                return response
            try:
                act(self._loop)
            except PhaseError as error:
                response.message = str(error)
                return response
            response.success = True
            response.message = self._loop.machine.state.phase.value
            return response

        return serve

    def _set_camera_info(self, request: Any, response: Any) -> Any:
        if self._camera is None:
            why = "is not configured" if self._loop is None else "has its camera elsewhere"
            response.status_message = f"{topics.RIG} {why}"
            return response
        try:
            self._camera.recalibrate(request.camera_info)
        except MessageError as error:
            response.status_message = str(error)
            return response
        response.success = True
        return response

    def _paced(self) -> list[str]:
        names = [name.strip() for name in self.configuration.pace_topics.split(",") if name.strip()]
        refuse_unknown(names, (topic.name for topic in topics.TOPICS), owner="pace_topics")
        return names

    def _answer(self, loop: MachineLoop, name: str) -> Callable[[bytes], None]:
        return lambda data: loop.answer(name, serialised_stamp_ns(data) * 1e-9)
