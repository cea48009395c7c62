"""The rig's node: services, clock, flow control, commands, motion-driven lay, hosted camera."""

import json
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commanded_machine import targets, winding
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from rig_bench import RigBench, refusal
from sensor_msgs.msg import CameraInfo, JointState
from sensor_msgs.srv import SetCameraInfo
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from winding_core.cable.cases import paper_case
from winding_core.machine.commands import AxisTarget, TensionCommand
from winding_core.machine.readings import AxisReading
from winding_core.markers import MARKER_DTYPE
from winding_core.status import Level
from winding_rig_node.machine.pace import Pace
from winding_rig_node.node import RigNode
from winding_rig_node.ros.hosted_camera import SilentRigError, open_camera
from winding_rig_node.ros.outputs import rig_status
from winding_ros import topics
from winding_ros.messages.camera import decode_camera_info, encode_camera_info
from winding_ros.messages.clouds import encode_cloud
from winding_ros.messages.rig import encode_joint_state, encode_tension
from winding_ros.messages.stamps import decode_stamp
from winding_ros.topic import Topic


def heard(ros: Any, **parameters: object) -> RigBench:
    """Return the bench of a rig of which everything is heard."""
    bench = RigBench(ros, **parameters)
    bench.hear()
    return bench


def test_time_stands_still_until_start(ros: Any) -> None:
    bench = heard(ros)
    assert bench.command("stop").message == "cannot stop while the machine is in idle"
    assert bench.stamps["/clock"] == []


def test_run_publishes_every_topic_at_its_rate(ros: Any) -> None:
    bench = heard(ros)
    bench.start()
    periods = {  # [ms]
        "/clock": 10, "rig/joint_states": 1, "rig/joint_commands": 20, "rig/tension": 10,
        "camera/image_raw": 5, "camera/camera_info": 5, "camera/image_raw/compressed": 40,
    }  # fmt: skip
    for name, period in periods.items():
        expected = list(range(0, 301, period))
        ros.spin_until(lambda name=name, expected=expected: bench.stamps[name] == expected)
    bench.wait_for("finished")


def test_time_waits_for_the_paced_consumer(ros: Any) -> None:
    bench = heard(ros, pace_topics="tracker/markers", max_lead=0.05)
    answers = topics.TRACKED_MARKERS.advertise(bench.probe)
    ros.spin_until(lambda: answers.get_subscription_count() == 1)
    bench.start()
    ros.spin_until(lambda: bench.last() == 50)
    # With no answer the rig may not take another sample, however long it is spun.
    for _ in range(20):
        ros.executor.spin_once(timeout_sec=0.01)
    assert bench.last() == 50
    answers.publish(encode_cloud(0.1, np.zeros(0, dtype=MARKER_DTYPE)))
    ros.spin_until(lambda: bench.last() == 150)


def test_emergency_stop_ends_motion_and_is_an_error(ros: Any) -> None:
    bench = heard(ros, duration=5.0)
    bench.start()
    ros.spin_until(lambda: bench.last() > 200)
    assert bench.command("emergency_stop").success
    assert bench.node.status().message == "emergency stop"
    assert not bench.command("start").success


def test_stop_then_reset_begins_anew_while_time_goes_on(ros: Any) -> None:
    bench = heard(ros, duration=5.0)
    bench.command("start")
    ros.spin_until(lambda: bench.last() > 100)
    assert not bench.command("reset").success
    assert bench.command("stop").success
    bench.wait_for("idle")
    before = bench.last()
    assert bench.command("reset").success
    bench.start()
    ros.spin_until(lambda: bench.last() > before + 10)


def test_inactive_rig_refuses_to_start(ros: Any) -> None:
    bench = heard(ros)
    assert bench.node.trigger_deactivate() is TransitionCallbackReturn.SUCCESS
    answer = bench.command("start")
    assert not answer.success
    assert answer.message == "winding_rig is not active"


@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ({"pace_topics": "tracker/markres"}, "tracker/markres"),
        ({"lay": "driven", "camera_elsewhere": True}, "camera_elsewhere must be false"),
        ({"truth_file": "absent/truth.json"},
         "truth_file must name a file in a folder that exists"),
        ({"carriage_travel": [0.5, 0.1]}, "travel must end above its start, got 0.5 to 0.1 m"),
    ],
)  # fmt: skip
def test_parameters_that_no_rig_can_have_are_refused(ros, parameters, sentence) -> None:
    assert sentence in refusal(ros, **parameters)


def test_new_calibration_is_carried_by_every_later_camera_info(ros: Any) -> None:
    bench = heard(ros)
    infos: list[Any] = []
    topics.CAMERA_INFO.subscribe(bench.probe, infos.append)
    present = bench.node._camera.calibration
    better = replace(present, matrix=present.matrix * [[1.01], [1.01], [1.0]])
    request = SetCameraInfo.Request(camera_info=encode_camera_info(0.0, better))
    assert ros.call(bench.probe, SetCameraInfo, "camera/set_camera_info", request).success
    ros.spin_until(lambda: bench.node.matched("camera/camera_info") == 2)
    bench.command("start")
    ros.spin_until(lambda: infos)
    reading = decode_camera_info(infos[0])[1]
    np.testing.assert_allclose(reading.matrix, better.matrix, rtol=1e-12)
    assert reading.window == present.window


@pytest.mark.parametrize(
    ("info", "sentence"),
    [
        (CameraInfo(), "camera is not calibrated"),
        (
            CameraInfo(
                width=64, height=48, k=np.eye(3).ravel(), d=[0.0] * 5, distortion_model="plumb_bob"
            ),
            "the sensor has 1920 x 1080 pixels, the calibration is for 64 x 48",
        ),
    ],
)
def test_calibration_of_no_camera_is_refused(ros: Any, info: CameraInfo, sentence: str) -> None:
    bench = heard(ros)
    request = SetCameraInfo.Request(camera_info=info)
    answer = ros.call(bench.probe, SetCameraInfo, "camera/set_camera_info", request)
    assert not answer.success
    assert sentence in answer.status_message


def test_clock_drives_a_node_that_uses_simulated_time(ros: Any) -> None:
    follower = ros.plain("follower")
    follower.set_parameters([Parameter("use_sim_time", value=True)])
    heard(ros).command("start")
    ros.spin_until(lambda: follower.get_clock().now().nanoseconds == 300_000_000)
    assert decode_stamp(follower.get_clock().now().to_msg()) == pytest.approx(0.3, abs=1e-9)


def driven(ros: Any, **parameters: object) -> RigBench:
    """Return the bench of a rig with such a lay that winds."""
    bench = RigBench(ros, **({"lay": "driven", "duration": 60.0} | parameters))
    bench.start()
    return bench


@pytest.mark.parametrize("lay", ["driven", "paper"])
def test_the_truth_is_there_at_the_end_of_the_run(ros: Any, tmp_path: Path, lay: str) -> None:
    file = tmp_path / "truth.json"
    bench = driven(ros, lay=lay, duration=0.5, truth_file=str(file))
    bench.wait_for("finished")
    ros.spin_until(file.exists)
    written = json.loads(file.read_text())
    turned = bench.node._loop.machine.state.cylinder.motor.position
    assert written["wound_angle"] == pytest.approx(turned)
    assert ("free_length" in written["hidden"]) == (lay == "driven")


def test_the_truth_of_a_run_that_is_ended_early_is_written_too(ros: Any, tmp_path: Path) -> None:
    file = tmp_path / "truth.json"
    bench = driven(ros, truth_file=str(file))
    bench.wound(0.5)
    assert bench.node.trigger_deactivate() is TransitionCallbackReturn.SUCCESS
    assert json.loads(file.read_text())["wound_angle"] == bench.node._lay.wound_angle > 0.5


def test_a_reset_begins_with_a_bare_cylinder(ros: Any) -> None:
    bench = driven(ros)
    bench.wound(0.5)
    assert bench.command("stop").success
    bench.wait_for("idle")
    assert bench.command("reset").success
    assert bench.node._lay.wound_angle == 0.0
    bench.start()
    # Its camera goes on, too: a picture that could not be drawn would fail the node.
    bench.wound(0.5)
    assert not bench.node._loop._failed


def test_the_camera_goes_on_after_a_pause_of_the_node(ros: Any) -> None:
    bench = driven(ros)
    bench.wound(0.3)
    assert bench.node.trigger_deactivate() is TransitionCallbackReturn.SUCCESS
    assert bench.node.trigger_activate() is TransitionCallbackReturn.SUCCESS
    stood = bench.node._lay.wound_angle
    bench.start()
    bench.wound(stood + 0.3)
    assert not bench.node._loop._failed


@pytest.mark.parametrize(
    "command", [targets(carriage=AxisTarget(speed=0.01)), TensionCommand(t=0.0, force=2.0)]
)
def test_commands_that_the_picture_does_not_follow_are_warned_of(command: Any) -> None:
    machine, pace = winding(), Pace([], 0.25)
    assert rig_status(machine, pace, "", "fem").level is Level.OK
    machine.command(command)
    status = rig_status(machine, pace, "", "fem")
    assert status.level is Level.WARN
    assert status.message == "winding: the camera shows lay 'fem', which does not follow commands"
    assert rig_status(machine, pace, "", "").level is Level.OK


class Commanded(RigBench):
    """A rig that winds in wall time, and a commander that repeats what it wants."""

    def __init__(self, ros: Any) -> None:
        super().__init__(ros, speed=1.0, duration=60.0)
        self.axes: Any = None
        self.force = 0.0
        topics.JOINT_STATES.subscribe(self.probe, lambda message: setattr(self, "axes", message))
        topics.TENSION.subscribe(self.probe, self._weigh)
        self.publishers = {
            topic: topic.advertise(self.probe) for topic in topics.published_by(topics.COMMANDER)
        }
        ros.spin_until(
            lambda: all(item.get_subscription_count() == 1 for item in self.publishers.values())
        )
        ros.spin_until(lambda: self.node.matched("rig/joint_states") == 1)
        self.start()
        ros.spin_until(lambda: self.axes is not None)

    def _weigh(self, message: Any) -> None:
        self.force = message.wrench.force.x

    def send(self, topic: Topic, message: Any) -> None:
        self.publishers[topic].publish(message)

    def until(self, reached: Any, topic: Topic, message: Any) -> None:
        """Repeat a command until what it asks for is there."""

        def look() -> bool:
            self.send(topic, message)
            return bool(reached())

        self.ros.spin_until(look)

    @property
    def carriage(self) -> float:
        return float(self.axes.position[1])

    @property
    def values(self) -> Any:
        return self.node.status().values


@pytest.mark.slow
def test_joint_targets_move_an_axis(ros: Any) -> None:
    bench = Commanded(ros)
    # As topic_based_ros2_control sends them: NaN for interfaces that are not commanded.
    wanted = JointState(
        name=["cylinder_joint", "carriage_joint"], position=[float("nan"), -0.01], velocity=[]
    )
    bench.until(lambda: abs(bench.carriage + 0.01) < 0.1e-3, topics.JOINT_TARGETS, wanted)
    assert bench.values["commanded"] == "carriage"
    assert bench.axes.velocity[0] > 0.5


@pytest.mark.slow
def test_a_joint_trajectory_moves_both_axes_to_its_end(ros: Any) -> None:
    bench = Commanded(ros)
    angle = bench.axes.position[0] + 0.5
    plan = JointTrajectory(joint_names=["carriage_joint", "cylinder_joint"])
    for nanosec, carriage in ((400_000_000, 0.01), (800_000_000, 0.02)):
        point = JointTrajectoryPoint(positions=[carriage, angle])
        point.time_from_start.nanosec = nanosec
        plan.points.append(point)
    bench.send(topics.JOINT_TRAJECTORY, plan)
    ros.spin_until(lambda: abs(bench.carriage - 0.02) < 0.1e-3)
    ros.spin_until(lambda: abs(bench.axes.position[0] - angle) < 1.0e-3)


@pytest.mark.slow
def test_a_tension_command_sets_the_brake(ros: Any) -> None:
    bench = Commanded(ros)
    pull = 1.5 * paper_case(4).weight
    bench.send(topics.TENSION_COMMAND, encode_tension(0.0, pull))
    ros.spin_until(lambda: abs(bench.force - pull) < 0.05)
    assert bench.values["brake [N]"] == f"{pull:.3f}"


@pytest.mark.slow
def test_a_refused_command_is_reported_in_diagnostics(ros: Any) -> None:
    bench = Commanded(ros)
    wanted = JointState(name=["carriage_joint"], position=[3.0])
    bench.send(topics.JOINT_TARGETS, wanted)
    ros.spin_until(lambda: "refusal" in bench.values)
    status = bench.node.status()
    assert status.message == "winding: carriage position must lie in -0.1 to 1 m, got 3"
    assert status.level is Level.WARN
    bench.send(topics.JOINT_TARGETS, JointState(name=["guide"], position=[0.0]))
    ros.spin_until(lambda: "joints must be" in bench.values["refusal"])
    assert bench.values["refused commands"] == "2"


@pytest.mark.slow
def test_two_commanders_at_once_are_refused(ros: Any) -> None:
    bench = Commanded(ros)
    other = topics.JOINT_TARGETS.advertise(ros.plain("other"))
    ros.spin_until(lambda: other.get_subscription_count() == 1)
    wanted = JointState(name=["carriage_joint"], velocity=[0.01])
    bench.until(lambda: "refusal" in bench.values, topics.JOINT_TARGETS, wanted)
    assert bench.values["refusal"] == "one commander at a time, got 2: other, probe"


@pytest.mark.slow
def test_a_commander_that_falls_silent_stops_the_machine(ros: Any) -> None:
    bench = Commanded(ros)
    wanted = JointState(name=["carriage_joint"], velocity=[0.02])
    bench.until(lambda: bench.axes.velocity[1] > 0.015, topics.JOINT_TARGETS, wanted)
    ros.spin_until(lambda: bench.values["phase"] == "idle")
    assert bench.values["reason"].startswith("no command for the carriage for more than 0.5 s")


STANDING = AxisReading(cylinder_angle=0.0, angular_speed=0.0, carriage_position=0.0, feed_speed=0.0)


class Port:
    """Keeps what a camera hands over."""

    def __init__(self, context: Any) -> None:
        self.context = context
        self.times: list[float] = []
        self.failures: list[Exception] = []
        self.fail = self.failures.append

    def calibrate(self, info: Any) -> None:
        """Every calibration will do."""

    def exposed(self, t: float, began_ns: int) -> None:
        """No trace is kept."""

    def take(self, t: float, frame: Any) -> None:
        self.times.append(t)


@pytest.fixture
def rig(ros: Any) -> Iterator[RigNode]:
    """A rig that another thread spins, as if it were another process."""
    node = RigNode(context=ros.context, parameter_overrides=[Parameter("case", value=4)])
    executor = SingleThreadedExecutor(context=ros.context)
    executor.add_node(node)
    ending = threading.Event()

    def spin() -> None:
        while not ending.is_set():
            executor.spin_once(timeout_sec=0.05)

    thread = threading.Thread(target=spin)
    thread.start()
    yield node
    ending.set()
    thread.join()
    executor.shutdown()
    node.destroy_node()


def test_what_was_chosen_since_the_process_was_started_is_filmed(ros: Any, rig: RigNode) -> None:
    rig.set_parameters([Parameter("frame_rate", value=1000)])
    joints, port = topics.JOINT_STATES.advertise(ros.plain()), Port(ros.context)
    with open_camera(port):
        ros.spin_until(lambda: joints.get_subscription_count() == 1)
        for sample in range(3):
            joints.publish(encode_joint_state(0.001 * sample, STANDING))
        ros.spin_until(lambda: len(port.times) == 3)
    assert port.times == [0.0, 0.001, 0.002]


def test_an_unusable_reading_does_not_end_the_camera(ros: Any, rig: RigNode) -> None:
    joints, port = topics.JOINT_STATES.advertise(ros.plain()), Port(ros.context)
    with open_camera(port):
        ros.spin_until(lambda: joints.get_subscription_count() == 1)
        joints.publish(JointState(name=["another_joint"], position=[0.0]))
        joints.publish(encode_joint_state(0.005, STANDING))
        ros.spin_until(lambda: port.times or port.failures)
    assert port.failures == []
    assert port.times == [0.005]


def test_without_a_rig_the_camera_is_refused_and_leaves_no_node(
    ros: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("winding_rig_node.ros.hosted_camera._ATTEMPTS", 1)
    probe = ros.plain()
    with (
        pytest.raises(SilentRigError, match="winding_rig has not reported its parameters within"),
        open_camera(Port(ros.context)),
    ):
        pytest.fail("opened")
    ros.spin_until(lambda: "winding_rig_camera" not in probe.get_node_names())
