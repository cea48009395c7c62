"""A camera in the tracker's process that shows frames drawn beforehand, at every joint state.

`python film_camera.py FILM.npy SECONDS RATE` draws case 4 as the paper measured it. In a run,
`--compose film_camera.py:open_camera` with the film's path in WINDING_FILM shows the frame of the
angle that the encoder has just reported, under the encoder's stamp.
"""

import json
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.node import Node

from winding_core.condition import Condition
from winding_core.machine_axes import MachineAxes
from winding_core.readings import ImageWindow
from winding_rig_node.camera.cable_path import CablePath
from winding_rig_node.camera.config import CameraConfig
from winding_rig_node.camera.renderer import Renderer
from winding_rig_node.camera.scene import Scene
from winding_rig_node.machine.lay import published_lay
from winding_ros import topics
from winding_ros.camera_messages import CameraReading, encode_camera_info
from winding_ros.polled import PolledTopic
from winding_ros.rig_messages import JointStateReader

CONDITION = Condition(case=4, duration=20.0)
# The cell reads its encoders this often at most [s].
LOOK_PERIOD = 0.0005


def draw(film: Path, seconds: float, rate: float) -> None:
    """Write the frames of the first seconds of the drive, and their rate."""
    what, drive = CONDITION.resolved(), CONDITION.resolved().drive
    end = float(drive.positions(20.0)[0])
    lay = published_lay(what.case, drive, what.free_length, end)
    path = CablePath(theta=lay.path_theta, z=lay.path_z)
    renderer, noise = Renderer(CameraConfig()), np.random.default_rng(1)
    of = CameraConfig().calibration()
    _, _, width, height = (size // of.binning for size in of.roi)
    count = round(seconds * rate) + 1
    frames = np.lib.format.open_memmap(
        film, mode="w+", dtype=np.uint8, shape=(count, height, width, 3)
    )
    for index in range(count):
        angle, way = drive.positions(index / rate)
        frames[index] = renderer.render(
            Scene(
                cylinder_radius=what.case.cylinder_radius,
                cable_radius=what.case.cable_radius,
                cylinder_angle=float(angle),
                cylinder_speed=float(drive.speeds(index / rate)[0]),
                path=path,
                marker_theta=lay.marker_theta,
                guide_z=float(way),
                free_length=what.free_length,
                band_width=0.006,
            ),
            noise,
        )
    film.with_suffix(".json").write_text(json.dumps({"rate": rate}), encoding="utf-8")


def calibration() -> CameraReading:
    of = CameraConfig().calibration()
    x, y, width, height = of.roi
    window = ImageWindow(x_offset=x, y_offset=y, width=width, height=height, binning=of.binning)
    return CameraReading(
        width=of.width, height=of.height, matrix=of.k, distortion=of.d, window=window
    )


@contextmanager
def open_camera(port: Any) -> Iterator[None]:
    path = Path(os.environ["WINDING_FILM"])
    frames = np.load(path, mmap_mode="r")
    rate = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))["rate"]
    # The angle of the drive is monotone, and so has one instant.
    instants = np.arange(len(frames)) / rate
    angles = np.array([float(CONDITION.resolved().drive.positions(t)[0]) for t in instants])
    node = Node("film_camera", context=port.context, enable_rosout=False)
    joints, read = PolledTopic(node, topics.JOINT_STATES), JointStateReader(MachineAxes())
    closing = threading.Event()
    port.calibrate(encode_camera_info(0.0, calibration()))

    def run() -> None:
        try:
            while not closing.wait(LOOK_PERIOD):
                for taken in joints.take():
                    t, reading = read(taken.data)
                    index = round(float(np.interp(reading.cylinder_angle, angles, instants)) * rate)
                    port.take(t, np.array(frames[index]))
        except Exception as error:  # noqa: BLE001 - ends the process
            port.fail(error)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        closing.set()
        thread.join()
        node.destroy_node()


if __name__ == "__main__":
    draw(Path(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3]))
