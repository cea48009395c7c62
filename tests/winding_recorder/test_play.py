"""Playback: the same bytes in the same order, at the rate that was asked for."""

import os
import subprocess
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from recordings import recorded
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import SetBool, Trigger

from processes import COMMAND
from winding_recorder.bags.description import BagError, StoredMessage, jazzy_channel
from winding_recorder.bags.mcap_file import BagConfig
from winding_recorder.bags.reading import messages_of, opened
from winding_recorder.bags.writer import BagWriter
from winding_recorder.playback.player import Pacing, Player
from winding_ros import topics
from winding_ros.messages.diagnostics import decode_diagnostics
from winding_ros.messages.rig import encode_tension
from winding_ros.topic import PolledTopic, Topic

pytestmark = pytest.mark.processes

JOINTS = "/winding/rig/joint_states"
SET = "/bag_player/set_parameters_atomically"
SAMPLES = 600


def position(place: float) -> SetParametersAtomically.Request:
    parameter = Parameter("position", value=place).to_parameter_msg()
    return SetParametersAtomically.Request(parameters=[parameter])


def renamed(topic: Topic) -> Topic:
    return replace(topic, name=f"/winding/{topic.name}")


@pytest.fixture
def play(ros: Any) -> Iterator[Any]:
    """Start a player on the harness's context in a thread; return it."""
    threads = []
    stopped = threading.Event()

    def start(bag: Path, pacing: Pacing, **options: Any) -> Player:
        player = Player(ros.plain("bag_player"), bag, pacing, **options)

        def work() -> None:
            player.wait_for_subscribers()
            player.play(stopped.is_set)

        thread = threading.Thread(target=work)
        thread.start()
        threads.append(thread)
        return player

    yield start
    stopped.set()
    for thread in threads:
        thread.join()


def test_the_command_publishes_the_recorded_bytes_in_order(ros: Any, made: Path) -> None:
    caller, node = ros.plain("caller"), ros.plain("listener_host")
    ros.executor.remove_node(node)
    polled = PolledTopic(node, renamed(topics.JOINT_STATES))
    with subprocess.Popen(
        [*COMMAND, "bag", "play", str(made), "--rate", "2", "--start-paused",
         "--domain", os.environ["ROS_DOMAIN_ID"]],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        # Held until this side knows it: on a busy machine discovery takes its time.
        ros.spin_until(lambda: caller.count_publishers(JOINTS) == 1)
        answer = ros.call(caller, Trigger, "/bag_player/toggle_paused", Trigger.Request())
        assert answer.message == "playing"
        heard: list[bytes] = []

        def ended() -> bool:
            heard.extend(taken.data for taken in polled.take())
            return process.poll() is not None

        ros.spin_until(ended)
        heard.extend(taken.data for taken in polled.take())
        out, err = process.communicate()
    ros.executor.add_node(node)
    assert process.returncode == 0, err
    assert "published 780 messages" in out
    wanted = recorded(made, JOINTS)
    # DDS pads a message to a multiple of four bytes.
    assert [data[: len(one)] for data, one in zip(heard, wanted, strict=True)] == wanted


def test_the_clock_goes_with_the_recording(ros: Any, made: Path, play: Any) -> None:
    times: list[int] = []
    ros.plain("watch").create_subscription(
        Clock, "/clock", lambda m: times.append(m.clock.sec * 10**9 + m.clock.nanosec), 1000
    )
    play(made, Pacing(2.0))
    # 0.599 s of recording hold 59 further ticks of 10 ms.
    ros.spin_until(lambda: len(times) >= 59)
    assert times == sorted(times)
    assert times[-1] >= 580_000_000


def test_pause_holds_every_message_and_going_on_sends_them(ros: Any, made: Path, play: Any) -> None:
    player = play(made, Pacing(20.0, paused=True))
    caller = ros.plain("caller")
    answer = ros.call(caller, SetBool, "/bag_player/set_paused", SetBool.Request(data=True))
    assert answer.success
    assert player.published == 0
    answer = ros.call(caller, Trigger, "/bag_player/toggle_paused", Trigger.Request())
    assert answer.message == "playing"
    ros.spin_until(lambda: player.published == 780)


def test_playback_goes_where_it_is_sent_and_reports_where(ros: Any, made: Path, play: Any) -> None:
    reported: dict[str, str] = {}
    caller = ros.plain("caller")
    caller.create_subscription(
        topics.DIAGNOSTICS.type,
        topics.DIAGNOSTICS.name,
        lambda message: reported.update(decode_diagnostics(message)[1][0].values),
        10,
    )
    player = play(made, Pacing(1.0, paused=True))
    ros.spin_until(lambda: float(reported.get("length", 0.0)) > 0.0)
    length = float(reported["length"])
    assert (float(reported["position"]), float(reported["paused"])) == (0.0, 1.0)
    with opened(made) as reader:
        arrived = [at * 1e-9 for _, at, _ in messages_of(reader, reader.connections)]
    begin, goals = arrived[-1] - length, [0.0]

    def until(place: float) -> int:
        return sum(at <= begin + place for at in arrived)

    # Forwards, back, and forwards: the last second before a place is there with it.
    for share in (0.71, 0.23, 0.94):
        place = round(share * length, 4)
        answer = ros.call(caller, SetParametersAtomically, SET, position(place)).result
        assert answer.successful, answer.reason
        goals.append(place)
        ros.spin_until(lambda: abs(float(reported["position"]) - goals[-1]) < 2e-3)
        ros.spin_until(lambda: player.published == sum(map(until, goals[1:])))
    for wrong in (-0.5, 3.0 * length):
        answer = ros.call(caller, SetParametersAtomically, SET, position(wrong)).result
        assert not answer.successful
        assert f"position must be from 0 to {length:.1f} s, got {wrong:g}" in answer.reason


def test_a_topic_that_somebody_publishes_is_refused(ros: Any, made: Path, play: Any) -> None:
    machine = ros.plain("machine")
    renamed(topics.JOINT_STATES).advertise(machine)
    with pytest.raises(BagError, match=f"{JOINTS} is published by machine already"):
        play(made, Pacing(1.0))
    player = play(made, Pacing(20.0), force=True)
    ros.spin_until(lambda: player.published == 780)


def test_arrivals_of_the_start_take_no_time(bags: Any, ros: Any, tmp_path: Path, play: Any) -> None:
    began = 1_764_000_000_000_000_000
    writer = bags.writer(tmp_path / "bag")
    early = bags.bytes_of(bags.tension, encode_tension(0.0, 1.5))
    writer.write(bags.tension, StoredMessage(early, began - 3600 * 10**9, 0))
    bags.write_run(writer, 100, began)
    writer.close()
    player = play(tmp_path / "bag", Pacing(1.0))
    ros.spin_until(lambda: player.published == 131)
    # An hour before is not late.
    assert player.latest < 1800.0


def test_an_unknown_topic_is_refused(made: Path, play: Any) -> None:
    with pytest.raises(BagError, match="has no topic /x"):
        play(made, Pacing(1.0), wanted=frozenset({"/x"}))


def test_latched_topics_reach_latecomers(bags: Any, ros: Any, tmp_path: Path, play: Any) -> None:
    topic = renamed(topics.FEM_PREDICTION)
    channel = jazzy_channel(topic.name, topic.type_name, depth=topic.depth, latched=True)
    writer = BagWriter(tmp_path / "bag", [channel], BagConfig())
    writer.write(0, StoredMessage(bytes(serialize_message(PointCloud2())), 0, 0))
    writer.close()
    player = play(tmp_path / "bag", Pacing(1.0))
    ros.spin_until(lambda: player.published == 1)
    heard: list[Any] = []
    topic.subscribe(ros.plain("late"), heard.append)
    ros.spin_until(lambda: len(heard) == 1)
