"""ROS adapter of the rig: sensors and clock out, start and stop in."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from rosgraph_msgs.msg import Clock
from sensor_msgs.srv import SetCameraInfo
from std_srvs.srv import Trigger

from cable_winding.parameters import refuse_unknown
from cable_winding.readings import ImageWindow
from cable_winding.ros import topics
from cable_winding.ros.camera_messages import (
    CameraReading,
    decode_camera_info,
    encode_camera_info,
    encode_image,
    encode_preview,
)
from cable_winding.ros.diagnostic_messages import Level, Status
from cable_winding.ros.managed_node import ManagedNode
from cable_winding.ros.rig_messages import MessageError, encode_joint_state, encode_tension
from cable_winding.ros.stamps import encode_stamp, serialised_stamp_ns
from winding_rig_node.camera.config import CameraCalibration, CameraConfig, SensorNoise
from winding_rig_node.camera.preview import encode_jpeg
from winding_rig_node.camera.renderer import Renderer
from winding_rig_node.camera.scene import Scene
from winding_rig_node.lay import CableLay, HiddenCable, published_lay, simulated_lay
from winding_rig_node.machine import SAMPLE_RATE, Machine, MachineConfig, Phase, PhaseError
from winding_rig_node.pace import Pace
from winding_rig_node.parameters import RigParameters

# A camera that falls behind by this many frames holds the machine's time.
_FRAME_QUEUE = 8
_POLL = 0.1
_SAMPLE_PERIOD = 1.0 / SAMPLE_RATE
# Stamps come back as seconds in binary: a microsecond decides nothing at 1 kHz.
_ROUNDING = 1.0e-6

FrameListener = Callable[[float, np.ndarray[Any, np.dtype[np.uint8]]], None]


@dataclass(frozen=True, kw_only=True)
class _Exposure:
    """One frame that the camera has to take."""

    t: float
    index: int
    cylinder_angle: float
    angular_speed: float
    guide_z: float


class RigNode(ManagedNode[RigParameters]):
    """Simulated winding machine; owns simulated time.

    Publishes /clock, rig/joint_states, rig/joint_commands, rig/tension, camera/image_raw,
    camera/camera_info, camera/image_raw/compressed. Serves rig/start, rig/stop, rig/reset,
    rig/emergency_stop, camera/set_camera_info. Listens to `pace_topics` for their stamps alone.

    The machine runs in a thread of its own with absolute deadlines, the camera in another; the
    executor only serves requests and answers.

    Attributes:
        frame_listener: When set, takes every frame in this process, from the camera's thread,
            and camera/image_raw falls silent; the preview goes on.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(topics.RIG, RigParameters, **kwargs)
        self._changed = threading.Condition()
        self._threads: list[threading.Thread] = []
        self._exposures: queue.Queue[_Exposure] = queue.Queue(_FRAME_QUEUE)
        self._machine: Machine | None = None
        self._quit = False
        for name, act in (
            ("rig/start", self._start),
            ("rig/stop", lambda machine: machine.stop()),
            ("rig/reset", lambda machine: machine.reset()),
            ("rig/emergency_stop", lambda machine: machine.emergency_stop()),
        ):
            self.create_service(Trigger, name, self._command(act))
        self.create_service(SetCameraInfo, "camera/set_camera_info", self._set_camera_info)
        self.frame_listener: FrameListener | None = None

    def configure(self) -> None:
        """Build machine, lay and camera; advertise everything."""
        wanted = self.configuration
        case, drive = wanted.condition(), wanted.drive()
        rng = np.random.default_rng(wanted.seed)
        end = drive.positions(wanted.duration)[0]
        self._lay: CableLay
        if wanted.lay == "paper":
            self._lay = published_lay(case, drive, wanted.free_length, end)
        else:
            self._lay = simulated_lay(case, drive, HiddenCable.drawn(rng), end)
        self._case = case
        self._camera_rng = np.random.default_rng([wanted.seed, 1])
        camera = CameraConfig(noise=SensorNoise(read=wanted.camera_noise))
        self._renderer = Renderer(camera)
        self._calibration = _reading(camera.calibration())
        # The first picture compiles the renderer: before time runs, not within it.
        self._render(_Exposure(t=0.0, index=0, cylinder_angle=0.0, angular_speed=0.0, guide_z=0.0))
        self._pace = Pace(self._paced(), wanted.max_lead)
        self._machine = Machine(
            MachineConfig(case=case, drive=drive, duration=wanted.duration), rng
        )
        self._clock_out = self.advertise(topics.CLOCK)
        self._joints = self.advertise(topics.JOINT_STATES)
        self._commands = self.advertise(topics.JOINT_COMMANDS)
        self._tension = self.advertise(topics.TENSION)
        self._image = self.advertise(topics.IMAGE)
        self._camera_info = self.advertise(topics.CAMERA_INFO)
        self._preview = self.advertise(topics.PREVIEW)
        for topic in topics.TOPICS:
            if topic.name in self._pace.answered:
                self.subscribe(topic, self._answer(topic.name), raw=True)

    def activate(self) -> None:
        """Start the machine's and the camera's threads; time waits for rig/start."""
        self._quit = False
        self._exposures = queue.Queue(_FRAME_QUEUE)
        self._threads = [
            threading.Thread(target=self._guard(self._run_machine), name="machine"),
            threading.Thread(target=self._guard(self._run_camera), name="camera"),
        ]
        for thread in self._threads:
            thread.start()

    def deactivate(self) -> None:
        """Stop both threads."""
        with self._changed:
            self._quit = True
            self._changed.notify_all()
        for thread in self._threads:
            thread.join()
        self._threads = []

    def cleanup(self) -> None:
        """Forget the machine."""
        self._machine = None

    def status(self) -> Status:
        """Return the machine's phase and time."""
        if self._machine is None:
            return Status(name=topics.RIG, message="not configured")
        machine = self._machine
        phase = machine.state.phase
        return Status(
            name=topics.RIG,
            level=Level.ERROR if phase is Phase.EMERGENCY else Level.OK,
            message=phase.value,
            values={"time": f"{machine.time:.3f}", "slowest": self._slowest()},
        )

    def _start(self, machine: Machine) -> None:
        # A client repeats a request whose answer was lost: starting twice is starting once.
        if machine.state.phase is not Phase.WINDING:
            self._pace.begin(machine.time)
        machine.start()

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
        if self._machine is None:
            response.status_message = f"{topics.RIG} is not configured"
            return response
        try:
            _, reading = decode_camera_info(request.camera_info)
        except MessageError as error:
            response.status_message = str(error)
            return response
        present = self._calibration
        if (reading.width, reading.height) != (present.width, present.height):
            response.status_message = (
                f"the sensor has {present.width} x {present.height} pixels, the calibration is "
                f"for {reading.width} x {reading.height}"
            )
            return response
        # The window is the driver's own: a calibration says nothing about it.
        self._calibration = replace(reading, window=present.window)
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
                    self._changed.wait(_POLL)
                    deadline = time.monotonic()
                    continue
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
            while machine.time + _SAMPLE_PERIOD > self._pace.limit + _ROUNDING and not self._quit:
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
        reading = machine.reading()
        if _due(sample, topics.CLOCK):
            self._clock_out.publish(Clock(clock=encode_stamp(t)))
        self._joints.publish(encode_joint_state(t, reading))
        if _due(sample, topics.JOINT_COMMANDS):
            self._commands.publish(encode_joint_state(t, machine.setpoints()))
        if _due(sample, topics.TENSION):
            self._tension.publish(encode_tension(t, machine.tension()))
        if _due(sample, topics.IMAGE):
            self._expose(
                _Exposure(
                    t=t,
                    index=sample,
                    cylinder_angle=machine.state.cylinder.motor.position,
                    angular_speed=machine.state.cylinder.motor.speed,
                    guide_z=machine.state.carriage.motor.position,
                )
            )

    def _expose(self, exposure: _Exposure) -> None:
        while not self._quit:
            try:
                self._exposures.put(exposure, timeout=_POLL)
            except queue.Full:
                continue
            return

    def _run_camera(self) -> None:
        while True:
            try:
                exposure = self._exposures.get(timeout=_POLL)
            except queue.Empty:
                if self._quit:
                    return
                continue
            frame = self._render(exposure)
            self._camera_info.publish(encode_camera_info(exposure.t, self._calibration))
            if self.frame_listener is None:
                self._image.publish(encode_image(exposure.t, frame))
            else:
                self.frame_listener(exposure.t, frame)
            if _due(exposure.index, topics.PREVIEW):
                jpeg = encode_jpeg(frame, self.configuration.preview_quality)
                self._preview.publish(encode_preview(exposure.t, jpeg))

    def _render(self, exposure: _Exposure) -> np.ndarray[Any, np.dtype[np.uint8]]:
        return self._renderer.render(
            Scene(
                cylinder_radius=self._case.cylinder_radius,
                cable_radius=self._case.cable_radius,
                cylinder_angle=exposure.cylinder_angle,
                cylinder_speed=exposure.angular_speed,
                path_theta=self._lay.path_theta,
                path_z=self._lay.path_z,
                marker_theta=self._lay.marker_theta,
                guide_z=exposure.guide_z,
                free_length=self.configuration.free_length,
                band_width=self.configuration.band_width,
            ),
            self._camera_rng,
        )


def _due(sample: int, topic: topics.Topic) -> bool:
    assert topic.rate is not None
    return sample % round(SAMPLE_RATE / topic.rate) == 0


def _reading(calibration: CameraCalibration) -> CameraReading:
    x, y, width, height = calibration.roi
    return CameraReading(
        width=calibration.width,
        height=calibration.height,
        matrix=calibration.k,
        distortion=calibration.d,
        window=ImageWindow(
            x_offset=x, y_offset=y, width=width, height=height, binning=calibration.binning
        ),
    )
