"""The rig's node: its commands, its clock, its flow control."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from rig_bench import RigBench, refusal
from sensor_msgs.msg import CameraInfo
from sensor_msgs.srv import SetCameraInfo

from winding_core.markers import MARKER_DTYPE
from winding_ros import topics
from winding_ros.camera_messages import decode_camera_info, encode_camera_info
from winding_ros.cloud_messages import encode_cloud
from winding_ros.stamps import decode_stamp


def heard(ros: Any, **parameters: object) -> RigBench:
    """Return the bench of a rig of which everything is heard."""
    bench = RigBench(ros, **parameters)
    bench.hear()
    return bench


def test_time_stands_still_until_start(ros):
    bench = heard(ros)
    assert bench.command("stop").message == "cannot stop while the machine is in idle"
    assert bench.stamps["/clock"] == []


def test_run_publishes_every_topic_at_its_rate(ros):
    bench = heard(ros)
    bench.start()
    rates = {"rig/joint_states": 1, "rig/joint_commands": 20, "rig/tension": 10, "/clock": 10}
    rates |= {"camera/image_raw": 5, "camera/camera_info": 5, "camera/image_raw/compressed": 40}
    for name, period in rates.items():
        expected = list(range(0, 301, period))
        ros.spin_until(lambda name=name, expected=expected: bench.stamps[name] == expected)
    bench.wait_for("finished")


def test_time_waits_for_the_paced_consumer(ros):
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


def test_emergency_stop_ends_motion_and_is_an_error(ros):
    bench = heard(ros, duration=5.0)
    bench.start()
    ros.spin_until(lambda: bench.last() > 200)
    assert bench.command("emergency_stop").success
    assert bench.node.status().message == "emergency stop"
    assert not bench.command("start").success


def test_stop_then_reset_begins_anew_while_time_goes_on(ros):
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


def test_inactive_rig_refuses_to_start(ros):
    bench = heard(ros)
    assert bench.node.trigger_deactivate() is TransitionCallbackReturn.SUCCESS
    answer = bench.command("start")
    assert not answer.success
    assert answer.message == "winding_rig is not active"


def test_unknown_pace_topic_is_refused(ros):
    assert "tracker/markres" in refusal(ros, pace_topics="tracker/markres")


def test_new_calibration_is_carried_by_every_later_camera_info(ros):
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
def test_calibration_that_cannot_be_the_camera_s_is_refused(ros, info, sentence):
    bench = heard(ros)
    request = SetCameraInfo.Request(camera_info=info)
    answer = ros.call(bench.probe, SetCameraInfo, "camera/set_camera_info", request)
    assert not answer.success
    assert sentence in answer.status_message


def test_clock_drives_a_node_that_uses_simulated_time(ros):
    follower = ros.plain("follower")
    follower.set_parameters([Parameter("use_sim_time", value=True)])
    bench = heard(ros)
    bench.command("start")
    ros.spin_until(lambda: follower.get_clock().now().nanoseconds == 300_000_000)
    assert decode_stamp(follower.get_clock().now().to_msg()) == pytest.approx(0.3, abs=1e-9)
