"""The rig's camera: takes exposures in a thread of its own, publishes pictures and calibration."""

import queue
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.cases import Case
from winding_core.machine.readings import AxisReading, ImageWindow
from winding_core.markers import DOT
from winding_rig_node.camera.config import CameraCalibration, CameraConfig, SensorNoise
from winding_rig_node.camera.pictures import encode_jpeg
from winding_rig_node.camera.renderer import Renderer
from winding_rig_node.camera.scene import Paint, Scene, paint_of_hue
from winding_rig_node.camera.shown_lay import ShownLay
from winding_rig_node.lay.lay_law import LayView, MotionLay
from winding_rig_node.machine.faults import Faults
from winding_rig_node.machine.machine import Machine
from winding_rig_node.machine.machine_config import SAMPLE_RATE
from winding_rig_node.ros.outputs import due
from winding_rig_node.ros.parameters import RigParameters
from winding_ros import topics
from winding_ros.messages.camera import CameraReading, decode_camera_info
from winding_ros.messages.serialised import MessageError
from winding_ros.runtime.node_trace import now_ns

CAMERA_SIGNAL = "camera"
# A camera that falls behind by this many frames holds the machine's time.
_FRAME_QUEUE = 8
_POLL = 0.1

FrameListener = Callable[[float, NDArray[np.uint8]], None]


@dataclass(frozen=True, kw_only=True)
class Exposure:
    """One frame that the camera has to take."""

    t: float  # [s]
    index: int  # Of the frame, from 0
    axes: AxisReading  # Where both stand then
    # What the machine has wound by then; None for a lay that is known ahead.
    lay: LayView | None = None


class Shown(Protocol):
    """Where frames and what goes with them are shown."""

    def exposed(self, t: float, began_ns: int) -> None:
        """Note that the pixels of a frame of time t [s] are there."""

    def camera_info(self, t: float, calibration: CameraReading) -> None:
        """Show the calibration of a frame of time t [s]."""

    def image(self, t: float, frame: NDArray[np.uint8]) -> None:
        """Show a frame, shape (rows, columns, 3), of time t [s]."""

    def preview(self, t: float, jpeg: bytes) -> None:
        """Show a compressed frame of time t [s]."""


class Camera:
    """Renders, encodes and shows frames."""

    def __init__(self, wanted: RigParameters, lay: ShownLay, outputs: Shown) -> None:
        self._wanted = wanted
        self._case: Case = wanted.resolved().case
        self._lay = lay
        drum, thickness = wanted.drum(self._case), self._case.cable_radius
        self._ends, self._flange = Scene.cylinder_ends, 0.0 if drum is None else drum.flange_height
        if drum is not None:
            low, high = drum.centre_lines(self._case.cable_diameter)
            self._ends = low - thickness, high + thickness
        self._outputs = outputs
        self._rng = np.random.default_rng([wanted.seed, 1])
        camera = CameraConfig(noise=SensorNoise(read=wanted.camera_noise))
        self._renderer = Renderer(camera)
        self._paint = Paint(markers=tuple(paint_of_hue(hue) for hue in wanted.hues))
        self._exposures: queue.Queue[tuple[Exposure, int]] = queue.Queue(_FRAME_QUEUE)
        self.calibration = reading_of(camera.calibration())  # What every later camera_info carries
        self.faults = Faults()  # What is wrong with it on purpose
        # When set, takes every frame instead of camera/image_raw.
        self.listener: FrameListener | None = None
        # The first picture compiles the renderer: before time runs, not within it.
        begin = AxisReading(
            cylinder_angle=0.0, angular_speed=0.0, carriage_position=0.0, feed_speed=0.0
        )
        self._render(Exposure(t=0.0, index=0, axes=begin))

    def recalibrate(self, info: Any) -> None:
        """Take a new calibration from a CameraInfo.

        Raises:
            MessageError: It is none, or one of another sensor.
        """
        _, reading = decode_camera_info(info)
        present = self.calibration
        if (reading.width, reading.height) != (present.width, present.height):
            raise MessageError(
                f"the sensor has {present.width} x {present.height} pixels, the calibration is "
                f"for {reading.width} x {reading.height}"
            )
        # The window is the driver's own: a calibration does not change it.
        self.calibration = replace(reading, window=present.window)

    def expose(self, exposure: Exposure, going: Callable[[], bool]) -> None:
        """Have a frame taken of the machine as it is now; wait while the camera is behind."""
        began = now_ns()
        while going():
            try:
                self._exposures.put((exposure, began), timeout=_POLL)
            except queue.Full:
                continue
            return

    def run(self, going: Callable[[], bool]) -> None:
        """Take exposures until `going` ends; the loop of the camera's thread."""
        while True:
            try:
                exposure, began = self._exposures.get(timeout=_POLL)
            except queue.Empty:
                if not going():
                    return
                continue
            self.take(exposure, began)

    def take(self, exposure: Exposure, began_ns: int) -> None:
        """Take a frame and show it.

        Args:
            exposure: What it shows.
            began_ns: When the machine stood so, by the clock of the trace.
        """
        frame = self._render(exposure)
        self._outputs.exposed(exposure.t, began_ns)
        channel = self.faults.of(CAMERA_SIGNAL)
        if channel is None:
            self._show(exposure.t, exposure.index, frame)
            return
        for delivery in channel.deliver(exposure.t, frame):
            pixels = np.asarray(delivery.values, dtype=np.uint8)
            self._show(delivery.t, round(delivery.t * SAMPLE_RATE), pixels)

    def _show(self, t: float, index: int, frame: NDArray[np.uint8]) -> None:
        self._outputs.camera_info(t, self.calibration)
        if self.listener is None:
            self._outputs.image(t, frame)
        else:
            self.listener(t, frame)
        if due(index, topics.PREVIEW):
            self._outputs.preview(t, encode_jpeg(frame, self._wanted.preview_quality))

    def _render(self, exposure: Exposure) -> NDArray[np.uint8]:
        axes = exposure.axes
        seen = self._lay.at(axes.carriage_position, exposure.lay)
        return self._renderer.render(
            seen.scene(
                self._case,
                axes.cylinder_angle,
                cylinder_speed=axes.angular_speed,
                cylinder_ends=self._ends,
                flange_height=self._flange,
                band_width=self._wanted.band_width,
                dot_size=self._wanted.dot_size if self._wanted.marker_kind == DOT else 0.0,
                paint=self._paint,
            ),
            self._rng,
        )


def exposure_of(machine: Machine, lay: MotionLay | None) -> Exposure:
    """Return what a frame shows that is taken of a machine, and of the lay it winds, now."""
    return Exposure(
        t=machine.time,
        index=machine.state.drive_sample,
        axes=machine.true_reading(),
        lay=None if lay is None else lay.view(),
    )


def reading_of(calibration: CameraCalibration) -> CameraReading:
    """Return a calibration as a CameraInfo has it."""
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
