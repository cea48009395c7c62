"""The simulated machine and its commander as two processes, with DDS between them."""

import json
import math
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from commanded_machine import MISSED, from_rest, sine
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import Trigger

from winding_core.cable.cases import paper_case
from winding_core.helix import PAPER_FREE_LENGTH, FleetAngleLaw
from winding_core.machine.drive import DriveProfile
from winding_core.status import Status
from winding_core.units import MILLISECOND
from winding_rig_node.camera import CameraConfig
from winding_rig_node.camera.optics import project_points
from winding_ros import topics
from winding_ros.message_guard import subscribers_of
from winding_ros.messages.diagnostics import decode_diagnostics
from winding_ros.messages.stamps import decode_stamp

pytestmark = [pytest.mark.campaign, pytest.mark.processes, pytest.mark.timeout(600)]

COMMANDER = Path(__file__).with_name("commander.py")
NAMESPACE = "commanded"
IN_NAMESPACE = ("--ros-args", "-r", f"__ns:=/{NAMESPACE}")
# Samples between two answers of the probe, and how often the last one is repeated [s].
ANSWERED, REPEATED = 5, 0.1
# It is judged for thirty seconds once the carriage has caught up with it [s].
CAUGHT_UP, END = 1.0, 31.0


class Bench:
    """A machine and a commander as processes, and what the machine publishes."""

    def __init__(self, ros: Any, start: Callable[..., subprocess.Popen[bytes]]) -> None:
        self.ros, self._start = ros, start
        # Time of the machine [s], position of the carriage [m], speeds of both axes.
        self.samples: list[tuple[float, float, list[float]]] = []
        self.statuses: list[Status] = []
        self.node = ros.add(Node, "probe", namespace=NAMESPACE)
        # The machine's time waits for who counts its samples, too, where `pace_topics` has it.
        self.answers, self.answer = topics.TRACKED_MARKERS.advertise(self.node), PointCloud2()
        self.node.create_timer(REPEATED, lambda: self.answers.publish(self.answer))
        topics.JOINT_STATES.subscribe(self.node, self._sampled)
        topics.DIAGNOSTICS.subscribe(self.node, self._reported)

    def wind(self, **parameters: object) -> None:
        """Bring a machine up; its time stands until a commander is there."""
        given = {"duration": 60.0, **parameters}.items()
        values = [word for name, value in given for word in ("-p", f"{name}:={value}")]
        self._start("-m", "winding_rig_node", *IN_NAMESPACE, *values)
        for transition in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
            request = ChangeState.Request(transition=Transition(id=transition))
            assert self._call(ChangeState, "winding_rig/change_state", request).success

    def command(self, course: str, rate: float = 50.0) -> subprocess.Popen[bytes]:
        """Start a commander, and the machine once they have found each other."""
        options = json.dumps({"course": course, "rate": rate})
        commander = self._start(COMMANDER, options, *IN_NAMESPACE)
        self.ros.spin_until(lambda: self.readers >= 2)
        assert self._call(Trigger, "rig/start", Trigger.Request()).success
        return commander

    def wait_for(self, text: str) -> Status:
        """Return the first status whose message has a text."""

        def found() -> list[Status]:
            return [status for status in self.statuses if text in status.message]

        self.ros.spin_until(found)
        return found()[0]

    @property
    def readers(self) -> int:
        """Who hears the encoders, as the machine knows it: this process and the commander."""
        own = [item for item in self.statuses if item.name == f"{topics.RIG}: topics"]
        return subscribers_of(own[-1].values).get(topics.JOINT_STATES.name, 0) if own else 0

    def _call(self, service: Any, name: str, request: Any) -> Any:
        return self.ros.call(self.node, service, name, request)

    def _sampled(self, message: Any) -> None:
        t = decode_stamp(message.header.stamp)
        self.samples.append((t, message.position[1], list(message.velocity)))
        if len(self.samples) % ANSWERED == 0:
            self.answer.header = message.header
            self.answers.publish(self.answer)

    def _reported(self, message: Any) -> None:
        self.statuses += decode_diagnostics(message)[1]


@pytest.fixture
def bench(ros: Any, tmp_path: Path) -> Iterator[Bench]:
    processes: list[subprocess.Popen[bytes]] = []

    def start(*arguments: object) -> subprocess.Popen[bytes]:
        processes.append(subprocess.Popen([sys.executable, *map(str, arguments)], cwd=tmp_path))
        return processes[-1]

    yield Bench(ros, start)
    for process in processes:
        process.kill()
        process.wait()


# The machine's time waits for the commander as it does for the nodes of a run: a slow computer
# makes the test long, and changes neither what is commanded nor when by its stamps.
@pytest.mark.parametrize(
    ("course", "rate", "meant"),
    [
        ("sine by position", 50.0, sine),
        ("sine by position", 100.0, sine),
        ("sine by speed", 100.0, from_rest),
    ],
)
def test_a_sine_from_another_process_is_followed(
    bench: Bench, course: str, rate: float, meant: Callable[[float], float]
) -> None:
    paced = f"{topics.FEM_MARKERS.name},{topics.TRACKED_MARKERS.name}"
    bench.wind(speed=0.0, pace_topics=paced, max_lead=1.0 / rate + MILLISECOND)
    bench.command(course, rate)
    bench.ros.spin_until(lambda: bench.samples and bench.samples[-1][0] >= END, 500.0)
    errors = [abs(at - meant(t)) for t, at, _ in bench.samples if CAUGHT_UP <= t <= END]
    # Every sample of 1 kHz.
    assert len(errors) == 30_001
    assert max(errors) < MISSED


def test_a_commanded_carriage_moves_the_lay_in_the_picture(bench: Bench, tmp_path: Path) -> None:
    frames: deque[Any] = deque(maxlen=1)
    topics.IMAGE.subscribe(bench.node, frames.append)
    truth = tmp_path / "truth.json"
    # P1 has landed and stands some 0.3 rad behind the contact line then.
    end = 4.3
    bench.wind(
        lay="driven",
        speed=0.0,
        duration=end,
        truth_file=truth,
        pace_topics=topics.FEM_MARKERS.name,
        max_lead=0.02 + MILLISECOND,
    )
    bench.command("sine by position")
    bench.ros.spin_until(lambda: frames and decode_stamp(frames[-1].header.stamp) >= end - 1.0e-6)
    bench.ros.spin_until(truth.exists)
    record = json.loads(truth.read_text())
    markers = record["markers"]
    angle = record["wound_angle"]
    theta, z = markers["theta"][1], markers["z"][1]
    case = paper_case(4)
    law = FleetAngleLaw(
        advance_per_radian=DriveProfile().advance_per_radian,
        free_length=PAPER_FREE_LENGTH,
        radius=case.centreline_radius,
    )
    # The carriage swayed about its start: nothing of the programme's feed is in the lay.
    assert abs(z) < 0.5 * float(law.z(theta))
    assert 0.0 < angle - theta < 0.5
    message = frames[-1]
    frame = np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, 3)
    yellow = cv2.inRange(cv2.cvtColor(frame, cv2.COLOR_BGR2HSV), (18, 110, 30), (38, 255, 255))
    # The outside of the cable, where the camera sees the band.
    outside = case.centreline_radius + case.cable_radius
    azimuth = angle - theta
    place = np.array([[outside * math.cos(azimuth), outside * math.sin(azimuth), z]])
    column, row = project_points(CameraConfig(), place)[0]
    rows, columns = np.nonzero(yellow)
    near = np.hypot(rows - row, columns - column) < 15.0
    # A band of 6 by 4 mm at 4.2 px/mm; one that lay by the programme would be 10 px away and more.
    assert near.sum() > 100
    assert columns[near].mean() == pytest.approx(column, abs=2.0)


def test_a_commander_that_is_killed_leaves_a_machine_at_rest(bench: Bench) -> None:
    bench.wind()
    commander = bench.command("steady speed")
    bench.ros.spin_until(lambda: bench.samples and bench.samples[-1][2][1] > 0.015)
    commander.kill()
    status = bench.wait_for("idle: no command for the carriage for more than 0.5 s")
    assert status.values["phase"] == "idle"
    # A standing machine publishes nothing; its last sample is below a hundredth of its speeds.
    bench.ros.spin_until(lambda: np.all(np.abs(bench.samples[-1][2]) < [0.0174, 0.05e-3]))
