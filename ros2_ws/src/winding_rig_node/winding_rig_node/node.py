"""ROS adapter of the rig: sensors and clock out, start and stop in."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from winding_core.parameters import refuse_unknown
from winding_core.status import Level, Status
from winding_rig_node.machine.faults import Faults
from winding_rig_node.machine.lay import CableLay, HiddenCable, published_lay, simulated_lay
from winding_rig_node.machine.machine import SAMPLE_RATE, Machine, MachineConfig, Phase, PhaseError
from winding_rig_node.machine.pace import Pace
from winding_rig_node.ros.camera import Camera, FrameListener
from winding_rig_node.ros.fault_parameters import follow_fault_parameters, stated_faults
from winding_rig_node.ros.outputs import Outputs, due
from winding_rig_node.ros.parameters import RigParameters
from winding_ros import graph, services, topics
from winding_ros.heartbeat import Sign, watch_heartbeat
from winding_ros.managed_node import ManagedNode
from winding_ros.rig_messages import MessageError
from winding_ros.stamps import serialised_stamp_ns

_POLL = 0.1
_STEP_POLL = 0.01
# A quick stop takes 0.3 s; a machine that does not come to rest may not keep its process.
_REST_PATIENCE = 0.6
_SAMPLE_PERIOD = 1.0 / SAMPLE_RATE
# Stamps come back as seconds in binary: a microsecond decides nothing at 1 kHz.
_ROUNDING = 1.0e-6


class RigNode(ManagedNode[RigParameters]):
    """Simulated winding machine; owns simulated time.

    Publishes and serves what `winding graph --interfaces` says. Listens to `pace_topics` for
    their stamps alone, and to the orchestrator's signs of life.

    The machine runs in a thread of its own with absolute deadlines, the camera in another; the
    executor only serves requests and answers.

    Attributes:
        frame_listener: When set, takes every frame in this process, from the camera's thread,
            and camera/image_raw falls silent; the preview goes on.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(graph.RIG, RigParameters, **kwargs)
        self._changed = threading.Condition()
        self._threads: list[threading.Thread] = []
        self._camera: Camera | None = None
        self._machine: Machine | None = None
        self._quit = False
        for service, act in (
            (services.START, self._start),
            (services.STOP, lambda machine: machine.stop()),
            (services.QUICK_STOP, lambda machine: machine.quick_stop()),
            (services.RESET, lambda machine: machine.reset()),
            (services.EMERGENCY_STOP, lambda machine: machine.emergency_stop()),
        ):
            service.serve(self, self._command(act))
        services.SET_CAMERA_INFO.serve(self, self._set_camera_info)
        self.frame_listener: FrameListener | None = None
        self._supervisor_heard = math.inf
        follow_fault_parameters(self, self._put_in)
        watch_heartbeat(self, topics.ORCHESTRATOR, self._note_supervisor)

    def configure(self) -> None:
        """Build machine, lay and camera; advertise everything."""
        wanted = self.configuration
        what = wanted.resolved()
        case, drive = what.case, what.drive
        rng = np.random.default_rng(wanted.seed)
        end = drive.positions(wanted.duration)[0]
        lay: CableLay
        if wanted.lay == "paper":
            lay = published_lay(case, drive, what.free_length, end)
        else:
            lay = simulated_lay(case, drive, HiddenCable.drawn(rng), end)
        self._outputs = Outputs(self)
        self._camera = Camera(wanted, lay, self._outputs)
        self._pace = Pace(self._paced(), wanted.max_lead)
        self._machine = Machine(
            MachineConfig(case=case, drive=drive, duration=wanted.duration), rng
        )
        self._put_in(
            stated_faults(wanted.inject_fault, enabled=wanted.inject_faults, seed=wanted.seed)
        )
        for topic in topics.TOPICS:
            if topic.name in self._pace.answered:
                self.endpoints.subscribe(topic, self._answer(topic.name), raw=True)

    def activate(self) -> None:
        """Start the machine's and the camera's threads; time waits for rig/start."""
        self._quit = False
        camera = self._camera
        assert camera is not None
        camera.listener = self.frame_listener
        self._threads = [
            threading.Thread(target=self._guard(self._run_machine), name="machine"),
            threading.Thread(target=self._guard(lambda: camera.run(self._going)), name="camera"),
        ]
        for thread in self._threads:
            thread.start()

    def deactivate(self) -> None:
        """Bring the axes to rest and stop both threads."""
        self.come_to_rest()
        with self._changed:
            self._quit = True
            self._changed.notify_all()
        for thread in self._threads:
            thread.join()
        self._threads = []

    def cleanup(self) -> None:
        """Forget the machine and its camera."""
        self._machine = self._camera = None

    def status(self) -> Status:
        """Return the machine's phase and time."""
        if self._machine is None:
            return Status(name=topics.RIG, message="not configured")
        state = self._machine.state
        faults = str(self.get_parameter("inject_fault").value)
        level = Level.WARN if state.reason or faults else Level.OK
        if state.phase in (Phase.EMERGENCY, Phase.PROTECTIVE):
            level = Level.ERROR
        values = {
            "time": f"{self._machine.time:.3f}",
            "phase": state.phase.value,
            "reason": state.reason,
            "slowest": self._slowest(),
        }
        # Of simulated time: what waits on the way to a reader, and in it, is not longer.
        values |= {
            f"lead over {name} [s]": f"{max(self._machine.time - t, 0.0):.3f}"
            for name, t in self._pace.answered.items()
        }
        refused = self._machine.plausibility.refused
        values |= {f"refused {name}": str(count) for name, count in refused.items()}
        if faults:
            values["faults"] = faults
        for name in ("stop_began", "stood_at"):
            moment = getattr(state, name)
            values |= {name: f"{moment:.3f}"} if moment is not None else {}
        return Status(
            name=topics.RIG,
            level=level,
            message=state.phase.value + (f": {state.reason}" if state.reason else ""),
            values=values,
        )

    def come_to_rest(self) -> None:
        """Stop both axes, and wait until they stand."""
        if not self._threads or self._machine is None:
            return
        with self._changed:
            self._machine.quick_stop("the node was told to end")
            self._changed.notify_all()
            end = time.monotonic() + _REST_PATIENCE
            while self._machine.moving and self._fatal is None and time.monotonic() < end:
                self._changed.wait(_STEP_POLL)

    def contested(self, sentence: str) -> None:
        """Stop the machine: somebody else speaks in its name."""
        self._stop_quickly(sentence)

    def _start(self, machine: Machine) -> None:
        if self.endpoints.rivals():
            raise PhaseError(f"cannot start while {self.endpoints.rivals()[0]}")
        self._supervisor_heard = time.monotonic()
        # A client repeats a request whose answer was lost: starting twice is starting once.
        if machine.state.phase is not Phase.WINDING:
            self._pace.begin(machine.time)
        machine.start()

    def _stop_quickly(self, reason: str) -> None:
        machine = self._machine
        if machine is None or machine.state.phase is not Phase.WINDING:
            return
        with self._changed:
            machine.quick_stop(reason)
            self._changed.notify_all()
        self.get_logger().error(f"stopped both axes: {reason}")

    def _note_supervisor(self, sign: Sign) -> None:
        if sign is Sign.ALIVE:
            self._supervisor_heard = time.monotonic()

    def _check_supervisor(self) -> None:
        limit = self.configuration.supervisor_timeout
        if limit > 0.0 and time.monotonic() - self._supervisor_heard > limit:
            self._stop_quickly(f"no sign of life of the orchestrator for {limit:g} s")

    def _put_in(self, faults: Faults) -> None:
        if self._machine is None or self._camera is None:
            return
        self._machine.faults = self._outputs.faults = self._camera.faults = faults

    def _going(self) -> bool:
        return not self._quit

    def _command(self, act: Callable[[Machine], None]) -> Callable[[Any, Any], Any]:
        def serve(_request: Any, response: Any) -> Any:
            if not self._threads or self._machine is None:
                response.message = f"{topics.RIG} is not active"
                return response
            try:
                with self._changed:
                    act(self._machine)
                    self._changed.notify_all()
            except PhaseError as error:
                response.message = str(error)
                return response
            response.success = True
            response.message = self._machine.state.phase.value
            return response

        return serve

    def _set_camera_info(self, request: Any, response: Any) -> Any:
        if self._camera is None:
            response.status_message = f"{topics.RIG} is not configured"
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

    def _answer(self, name: str) -> Callable[[bytes], None]:
        def note(data: bytes) -> None:
            with self._changed:
                self._pace.answer(name, serialised_stamp_ns(data) * 1e-9)
                self._changed.notify_all()

        return note

    def _slowest(self) -> str:
        return self._pace.slowest if self._pace.answered else ""

    def _guard(self, work: Callable[[], None]) -> Callable[[], None]:
        def run() -> None:
            try:
                work()
            except Exception as error:  # noqa: BLE001 - handed to the executor's thread
                self.fail(error)

        return run

    def _run_machine(self) -> None:
        machine = self._machine
        assert machine is not None
        begun = machine.state.drive_sample > 0
        deadline = time.monotonic()
        while not self._quit:
            with self._changed:
                if not machine.moving:
                    self._changed.notify_all()
                    self._changed.wait(_POLL)
                    deadline = time.monotonic()
                    continue
            self._check_supervisor()
            if not begun:
                self._emit(machine)
                begun = True
            if not self._wait_for_consumers(machine):
                continue
            deadline = self._wait_for_deadline(machine, deadline)
            with self._changed:
                machine.step()
            self._emit(machine)

    def _wait_for_consumers(self, machine: Machine) -> bool:
        """Return whether time may go on; False when told to quit meanwhile."""
        last_answer = time.monotonic()
        with self._changed:
            while machine.time + _SAMPLE_PERIOD > self._pace.limit + _ROUNDING:
                # A machine that has to stand soon waits for nobody.
                if self._quit or machine.hurried:
                    break
                self._check_supervisor()
                if self._changed.wait(_POLL):
                    last_answer = time.monotonic()
                elif time.monotonic() - last_answer > self.configuration.pace_timeout:
                    raise TimeoutError(
                        f"no answer on {self._pace.slowest} for "
                        f"{self.configuration.pace_timeout:g} s at {machine.time:.3f} s of "
                        "simulated time"
                    )
        return not self._quit

    def _wait_for_deadline(self, machine: Machine, deadline: float) -> float:
        """Sleep until the next control step is due; return the following deadline."""
        speed = self.configuration.speed
        if speed == 0.0:
            return deadline
        # Sleeping once per control step halves the wake-ups of a 1 kHz loop.
        if machine.state.drive_sample % 2 == 0:
            time.sleep(max(0.0, deadline - time.monotonic()))
        return deadline + 1.0 / (SAMPLE_RATE * speed)

    def _emit(self, machine: Machine) -> None:
        t, sample = machine.time, machine.state.drive_sample
        if due(sample, topics.CLOCK):
            self._outputs.clock(t)
        self._outputs.joints(topics.JOINT_STATES, t, machine.reading())
        if due(sample, topics.JOINT_COMMANDS):
            self._outputs.joints(topics.JOINT_COMMANDS, t, machine.setpoints())
        self._outputs.measured(t, sample, machine.sensors)
        if due(sample, topics.IMAGE) and self._camera is not None:
            self._camera.expose(machine, self._going)
