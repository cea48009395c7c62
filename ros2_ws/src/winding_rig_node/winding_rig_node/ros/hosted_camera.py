"""The simulated camera in the process that tracks its frames: `winding run --compose camera`."""

import contextlib
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python

from winding_core.machine.axes import MachineAxes
from winding_core.machine.readings import AxisReading
from winding_core.parameters import build, declarations
from winding_rig_node.camera.shown_lay import KnownLay
from winding_rig_node.machine.machine_config import SAMPLE_RATE
from winding_rig_node.ros.camera import Camera, Exposure
from winding_rig_node.ros.parameters import RigParameters
from winding_ros import topics
from winding_ros.messages.camera import CameraReading, encode_camera_info
from winding_ros.messages.rig import JointStateReader
from winding_ros.messages.serialised import MessageError
from winding_ros.runtime.node_trace import now_ns
from winding_ros.topic import PolledTopic

# An answer is lost while client and server find each other, so the request is repeated.
_ATTEMPTS = 20
_PATIENCE = 0.5


class SilentRigError(ValueError):
    """The rig does not answer with its parameters."""


def asked_parameters(node: Node) -> RigParameters:
    """Return the present parameters of the rig in a node's namespace.

    Args:
        node: Asks; added to no executor.

    Raises:
        SilentRigError: The rig does not answer.
        ParameterError: It answers with something else.
    """
    names = [item.name for item in declarations(RigParameters)]
    client = node.create_client(GetParameters, f"{topics.RIG}/get_parameters")
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    try:
        for _ in range(_ATTEMPTS):
            if not client.wait_for_service(timeout_sec=_PATIENCE):
                continue
            answer = client.call_async(GetParameters.Request(names=names))
            executor.spin_until_future_complete(answer, timeout_sec=_PATIENCE)
            if answer.done():
                values = map(parameter_value_to_python, answer.result().values)
                given = dict(zip(names, values, strict=False))
                return build(RigParameters, given, owner=topics.RIG)
    finally:
        executor.remove_node(node)
        executor.shutdown()
        node.destroy_client(client)
    waited = _ATTEMPTS * _PATIENCE
    raise SilentRigError(f"{topics.RIG} has not reported its parameters within {waited:g} s")


_NAME = "winding_rig_camera"
_LOOK_PERIOD = 0.002  # The machine publishes bursts of 5 ms


class Port(Protocol):
    """What takes the frames."""

    context: Any

    def calibrate(self, info: Any) -> None:
        """Take the CameraInfo of the frames that follow."""

    def take(self, t: float, frame: NDArray[np.uint8]) -> None:
        """Take a frame of time t [s], shape (height, width, 3)."""

    def exposed(self, t: float, began_ns: int) -> None:
        """Note that the pixels of a frame are there."""

    def fail(self, error: Exception) -> None:
        """End the process with an error."""


@contextmanager
def open_camera(port: Port) -> Iterator[None]:
    """Hand over a frame of the simulated machine, drawn where its encoders are.

    What is wound, and how, is asked of the rig each time: an operator may have chosen something
    else since the process was started.

    Args:
        port: Takes the frames, from a thread of the camera's own.

    Raises:
        SilentRigError: The rig does not answer with its parameters.
    """
    node = Node(_NAME, context=port.context, enable_rosout=False, start_parameter_services=False)
    closing = threading.Event()
    try:
        wanted = asked_parameters(node)
        lay = wanted.laid(np.random.default_rng(wanted.seed))
        camera = Camera(wanted, KnownLay(lay, wanted.free_length), _Handover(port))
        port.calibrate(encode_camera_info(0.0, camera.calibration))
        joints, read = PolledTopic(node, topics.JOINT_STATES), JointStateReader(MachineAxes())

        def run() -> None:
            try:
                while not closing.wait(_LOOK_PERIOD):
                    for t, reading in _usable(joints, read):
                        index = round(t * SAMPLE_RATE)
                        if index % wanted.frame_period == 0:
                            camera.take(Exposure(t=t, index=index, axes=reading), now_ns())
            except Exception as error:  # noqa: BLE001 - handed to the executor's thread
                port.fail(error)

        thread = threading.Thread(target=run, name="camera")
        thread.start()
        try:
            yield
        finally:
            closing.set()
            thread.join()
    finally:
        node.destroy_node()


class _Handover:
    """Shows frames to the port; calibration and preview are its own business."""

    def __init__(self, port: Port) -> None:
        self.exposed = port.exposed
        self.image = port.take

    def camera_info(self, t: float, calibration: CameraReading) -> None:
        """Leave it to the port, which has the calibration."""

    def preview(self, t: float, jpeg: bytes) -> None:
        """Leave it to the port."""


def _usable(joints: PolledTopic, read: JointStateReader) -> Iterator[tuple[float, AxisReading]]:
    """Yield the usable joint states that have arrived; the tracker counts the others."""
    for taken in joints.take():
        with contextlib.suppress(MessageError):
            yield read(taken.data)
