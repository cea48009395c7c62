"""A cell with encoders, load cell and camera, as a process of its own: wall clock, own threads.

`python camera_cell.py '{"joint_rate": 100.0, ...}' --ros-args -r __ns:=/cell`; the fields of `Cell`
describe what is odd about it. It winds what the paper measured of a case. Its encoders never start
anew: rig/reset puts a new cable on where the machine stands.
"""

import json
import math
import queue
import random
import sys
import time
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import cv2
from pictures import Pictures
from sensor_cell import SensorCell, run_cell
from sensor_msgs.msg import JointState

from winding_ros.messages.camera import encode_camera_info, encode_image, encode_preview
from winding_ros.messages.stamps import encode_stamp

_JPEG = (cv2.IMWRITE_JPEG_QUALITY, 95)  # As image_transport's compressed publisher by default


class Pause(NamedTuple):
    """A while for which the machine stands."""

    at: float  # Time of the programme [s]
    length: float  # [s]
    frames: bool  # Whether the camera goes on meanwhile


@dataclass(frozen=True, kw_only=True)
class Cell:
    case: int = 4  # Row of the paper's Table 2
    joint_rate: float = 200.0  # Encoder samples per second
    frame_rate: float = 50.0  # Frames per second; 0 for a camera in another process
    angle: float = 0.0  # Reading of the cylinder's encoder where it stands at first [rad]
    carriage: float = 0.0  # Reading of the carriage's encoder there [m]
    reversed: bool = False  # Whether both encoders count backwards
    velocities: bool = True  # Whether the drives measure speeds
    loss: float = 0.0  # Share of joint states that is never published
    jitter: float = 0.0  # Longest delay of a joint state, in order [s]
    camera_offset: float = 0.0  # Of the camera's clock [s]
    compressed: bool = False  # Whether its frames come as JPEG, on the compressed topic
    pauses: tuple[Pause, ...] = ()  # In which the machine stands, in order


@dataclass(frozen=True, kw_only=True)
class Motion:
    """One motion from a start to the next stop, on wall time [s]."""

    since: float = 0.0  # Time of the drive's programme at its start
    begun: float = math.inf  # Its start
    ended: float = math.inf  # The stop
    angle: float  # Reading of the cylinder's encoder at the programme's start [rad]
    carriage: float  # Reading of the carriage's encoder there [m]

    def time(self, now: float) -> float:
        return self.since + max(0.0, min(now, self.ended) - self.begun)

    def goes_on(self, now: float) -> bool:
        return self.begun <= now < self.ended


class CellNode(SensorCell):
    """Winds what the paper measured, with the oddities of a cell."""

    def __init__(self, cell: Cell) -> None:
        super().__init__(cell.case, camera=bool(cell.frame_rate))
        self.cell = cell
        self.drive = self.what.drive
        # The threads look at it while a service replaces it.
        self.motion = Motion(angle=cell.angle, carriage=cell.carriage)
        self.latched = False
        self.random = random.Random(1)
        self.pictures = Pictures(cell.case)
        # The first picture compiles the renderer.
        self.pictures.at(0.0)
        self.outbox: queue.SimpleQueue[tuple[float, JointState]] = queue.SimpleQueue()
        camera = [self.photograph] if cell.frame_rate else []
        self.begin(self.encode, partial(self.later, self.outbox), *camera)

    def start(self) -> bool:
        if not self.latched:
            now = time.time()
            since = self.motion.time(now)
            self.motion = replace(self.motion, since=since, begun=now, ended=math.inf)
        return not self.latched

    def stop(self) -> bool:
        self.motion = replace(self.motion, ended=min(self.motion.ended, time.time()))
        return True

    def emergency_stop(self) -> bool:
        self.latched = True
        return self.stop()

    def reset(self) -> bool:
        now = time.time()
        self.latched, stands = False, not self.motion.goes_on(now)
        if stands:
            angle, carriage = self.readings(self.motion, now)
            self.motion = Motion(angle=angle, carriage=carriage)
        return stands

    def readings(self, motion: Motion, now: float) -> tuple[float, float]:
        """Return what the encoders of cylinder [rad] and carriage [m] read at wall time `now`."""
        sign = -1.0 if self.cell.reversed else 1.0
        angle, way = self.drive.positions(self.programme(motion, now)[0])
        return motion.angle + sign * float(angle), motion.carriage + sign * float(way)

    def programme(self, motion: Motion, now: float) -> tuple[float, Pause | None]:
        """Return how far the programme has come at wall time `now` [s], and the pause it is in."""
        t = motion.time(now)
        for pause in self.cell.pauses:
            if t < pause.at:
                break
            if t < pause.at + pause.length:
                return pause.at, pause
            t -= pause.length
        return t, None

    def encode(self) -> None:
        cell = self.cell
        sign = -1.0 if cell.reversed else 1.0
        for due in self.instants(1.0 / cell.joint_rate):
            motion = self.motion
            angle, carriage = self.readings(motion, due)
            t, pause = self.programme(motion, due)
            omega, feed = self.drive.speeds(t)
            still = pause is not None or not motion.goes_on(due)
            message = JointState(name=["carriage_joint", "cylinder_joint"])
            message.header.stamp = encode_stamp(due)
            message.position = [carriage, angle]
            if cell.velocities:
                message.velocity = [0.0, 0.0] if still else [sign * feed, sign * omega]
            if self.random.random() >= cell.loss:
                self.outbox.put((due + cell.jitter * self.random.random(), message))
            self.publish_force(message)

    def photograph(self) -> None:
        cell = self.cell
        for due in self.instants(1.0 / cell.frame_rate):
            t, pause = self.programme(self.motion, due)
            if pause is not None and not pause.frames:
                continue
            stamp = due + cell.camera_offset
            self.infos.publish(encode_camera_info(stamp, self.pictures.calibration))
            frame = self.pictures.at(t)
            if cell.compressed:
                jpeg = cv2.imencode(".jpg", frame, _JPEG)[1]
                self.compressed_images.publish(encode_preview(stamp, jpeg.tobytes()))
            else:
                self.images.publish(encode_image(stamp, frame))


if __name__ == "__main__":
    odd = json.loads(sys.argv[1])
    odd["pauses"] = tuple(Pause(*pause) for pause in odd.get("pauses", ()))
    run_cell(lambda: CellNode(Cell(**odd)))
