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
from pictures import Pictures
from rclpy.node import Node

from winding_core.machine.axes import MachineAxes
from winding_ros import topics
from winding_ros.messages.camera import encode_camera_info
from winding_ros.messages.rig import JointStateReader
from winding_ros.topic import PolledTopic

CASE = 4
LOOK_PERIOD = 0.0005  # The cell reads its encoders this often at most [s]


def draw(film: Path, seconds: float, rate: float) -> None:
    """Write the frames of the first seconds of the drive, and their rate."""
    pictures, count = Pictures(CASE), round(seconds * rate) + 1
    frames = np.lib.format.open_memmap(
        film, mode="w+", dtype=np.uint8, shape=(count, *pictures.shape)
    )
    for index in range(count):
        frames[index] = pictures.at(index / rate)
    film.with_suffix(".json").write_text(json.dumps({"rate": rate}), encoding="utf-8")


@contextmanager
def open_camera(port: Any) -> Iterator[None]:
    path, pictures = Path(os.environ["WINDING_FILM"]), Pictures(CASE)
    frames = np.load(path, mmap_mode="r")
    rate = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))["rate"]
    # The angle of the drive is monotone, and so has one instant.
    instants = np.arange(len(frames)) / rate
    angles = np.array([float(pictures.drive.positions(t)[0]) for t in instants])
    node = Node("film_camera", context=port.context, enable_rosout=False)
    joints, read = PolledTopic(node, topics.JOINT_STATES), JointStateReader(MachineAxes())
    closing = threading.Event()
    port.calibrate(encode_camera_info(0.0, pictures.calibration))

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
