"""A cell whose carriage is commanded, as a process of its own: wall clock, own units, own lay law.

`python commanded_cell.py SEED TRUTH.json --ros-args -r __ns:=/cell`. Its spindle counts radians
from anywhere, its slide millimetres against the cable's z. The slide follows rig/joint_targets with
a lag of its own. The cable lies by a law that is none of the project's: the length of the span
follows from the seed; it sags by a share of the lead, and the eye wobbles with the drum. TRUTH is
written at the end: wound angles [rad] and z [m] of the lay, and the markers' angles.
"""

import json
import math
import sys
import time
from pathlib import Path

import numpy as np
from sensor_cell import SensorCell, run_cell
from sensor_msgs.msg import JointState

from winding_core.cable.cases import paper_case
from winding_rig_node.camera.cable_path import CablePath
from winding_rig_node.camera.config import CameraConfig
from winding_rig_node.camera.renderer import Renderer
from winding_rig_node.camera.scene import Scene
from winding_rig_node.ros.camera import reading_of
from winding_ros.messages.camera import encode_camera_info, encode_image
from winding_ros.messages.stamps import encode_stamp

CASE = 4
PERIOD = 0.005
FRAMES = 10
STEP = 0.01
# Readings where the machine stands at first [rad], [mm]; millimetres count against z.
SPINDLE, SLIDE, SCALE = 12.5, 340.0, -1000.0


class Drum:
    """The cable on the drum, by a law of its own.

    Args:
        rng: Of what is hidden.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self.case = paper_case(CASE)
        self.radius = self.case.centreline_radius
        self.length = rng.uniform(0.165, 0.225)
        self.sag = rng.uniform(0.0, 0.05)
        self.wobble, self.phase = rng.uniform(0.0, 1.0e-4), rng.uniform(0.0, 2.0 * math.pi)
        self.stretch = rng.uniform(1.01, 1.06)
        self.theta, self.z, self.slope = 0.0, 0.0, 0.0
        self.path: list[tuple[float, float]] = [(0.0, 0.0)]
        self.laid = 0.0
        self.markers = [0.0]

    def turn(self, theta: float, eye: float) -> None:
        """Go on to a wound angle [rad] with the eye at a place [m]."""
        while theta - self.theta > STEP:
            self._step(STEP, eye)
        self._step(theta - self.theta, eye)

    def _step(self, turned: float, eye: float) -> None:
        if turned <= 0.0:
            return
        eye += self.wobble * math.sin(self.theta + self.phase)
        lead = (1.0 - self.sag) * (eye - self.z)
        # The cable comes round to the direction of the span within a tenth of a radian.
        aim = lead * self.radius / self.length
        self.slope += (aim - self.slope) * -math.expm1(-turned / 0.1)
        self.theta += turned
        self.z += self.slope * turned
        self.laid += math.hypot(self.radius, self.slope) * turned / self.stretch
        if self.laid >= len(self.markers) * self.case.marker_spacing:
            self.markers.append(self.theta)
        if self.theta - self.path[-1][0] > 0.05:
            self.path.append((self.theta, self.z))

    def shown_markers(self) -> np.ndarray:
        """Return the markers' angles, those to come at the present rate [rad]."""
        rate = self.stretch / math.hypot(self.radius, self.slope)
        count = self.case.marker_count + 1
        ahead = [
            self.theta + (n * self.case.marker_spacing - self.laid) * rate
            for n in range(len(self.markers), count)
        ]
        return np.array([*self.markers[:count], *ahead])


class CommandedCell(SensorCell):
    def __init__(self, seed: int, truth: Path) -> None:
        super().__init__(CASE, camera=True)
        rng = np.random.default_rng(seed)
        self.drum, self.truth = Drum(rng), truth
        self.lag = rng.uniform(0.01, 0.05)
        self.noise = rng
        self.begun = self.ended = math.inf
        self.target: tuple[float, float, float] | None = None
        self.create_subscription(JointState, "rig/joint_targets", self.take, 1)
        config = CameraConfig()
        self.renderer, self.calibration = Renderer(config), reading_of(config.calibration())
        # The first picture compiles the renderer.
        self.picture(0.0, 0.0)
        self.begin(self.work)

    def take(self, message: JointState) -> None:
        """Take where the slide has to be [mm], and its rate [mm/s]."""
        at = message.name.index("slide")
        self.target = (time.time(), message.position[at], message.velocity[at])

    def start(self) -> bool:
        self.begun = time.time()
        return True

    def stop(self) -> bool:
        self.ended = min(self.ended, time.time())
        return True

    def reset(self) -> bool:
        return True

    def work(self) -> None:
        """Turn, follow, measure and photograph on an absolute schedule."""
        slide = SLIDE
        for sample, due in enumerate(self.instants(PERIOD), start=1):
            t = max(0.0, min(due, self.ended) - self.begun)
            theta = float(self.what.drive.positions(t)[0])
            omega = float(self.what.drive.speeds(t)[0]) if self.begun <= due < self.ended else 0.0
            before = slide
            if self.target is not None:
                since, position, speed = self.target
                aim = position + speed * min(due - since, 0.1) if omega else position
                slide += (aim - slide) * -math.expm1(-PERIOD / self.lag)
            eye = (slide - SLIDE) / SCALE
            self.drum.turn(theta, eye)
            message = JointState(name=["slide", "spindle"])
            message.header.stamp = encode_stamp(due)
            message.position = [slide, SPINDLE + theta]
            message.velocity = [(slide - before) / PERIOD, omega]
            self.joints.publish(message)
            self.publish_force(message)
            if sample % FRAMES == 0:
                self.infos.publish(encode_camera_info(due, self.calibration))
                self.images.publish(encode_image(due, self.picture(theta, omega, eye)))

    def picture(self, theta: float, omega: float, eye: float = 0.0) -> np.ndarray:
        drum = self.drum
        path = np.array([*drum.path, (max(theta, drum.path[-1][0] + 1.0e-6), drum.z)])
        if path.shape[0] < 3:
            path = np.array([(0.0, 0.0), (0.5e-6, 0.0), (1.0e-6, 0.0)])
        return self.renderer.render(
            Scene(
                cylinder_radius=drum.case.cylinder_radius,
                cable_radius=drum.case.cable_radius,
                cylinder_angle=theta,
                cylinder_speed=omega,
                path=CablePath(theta=path[:, 0], z=path[:, 1]),
                marker_theta=drum.shown_markers(),
                guide_z=eye,
                free_length=drum.length,
                band_width=0.006,
            ),
            self.noise,
        )

    def write(self) -> None:
        theta, z = np.array(self.drum.path).T
        record = {"theta": theta.tolist(), "z": z.tolist(), "markers": self.drum.markers[1:]}
        self.truth.write_text(json.dumps(record), encoding="utf-8")


if __name__ == "__main__":
    cell = run_cell(lambda: CommandedCell(int(sys.argv[1]), Path(sys.argv[2])))
    assert isinstance(cell, CommandedCell)
    cell.write()
