"""The recorded bag, seen by readers that the project did not write."""

from collections import Counter
from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from winding_ros import topics

pytestmark = pytest.mark.processes

RECORDED = {
    (topic.name if topic.name.startswith("/") else f"/winding/{topic.name}"): topic
    for topic in topics.TOPICS
    if topic.recorded
}

# Nobody commands this run from outside, and no lay is controlled in it.
SILENT = {
    name
    for name, topic in RECORDED.items()
    if topic.publisher in (topics.COMMANDER, topics.LAY_CONTROL)
}


@pytest.fixture(scope="module")
def bag(recorded_run: Any) -> Path:
    assert recorded_run.finished.returncode == 0, recorded_run.finished.stderr
    return recorded_run.bag


def test_any_reader_finds_every_topic_of_the_contract(bag: Path) -> None:
    with AnyReader([bag]) as reader:
        found = {connection.topic: connection for connection in reader.connections}
        assert set(found) == set(RECORDED)
        for name, connection in found.items():
            assert connection.msgtype == RECORDED[name].type_name
            assert (connection.msgcount > 0) is (name not in SILENT)
            assert connection.digest.startswith("RIHS01_")


def test_every_topic_is_there_from_the_start(bag: Path) -> None:
    first: dict[str, int] = {}
    with AnyReader([bag]) as reader:
        for connection, stamp, _ in reader.messages():
            first.setdefault(connection.topic, stamp)
        begin = reader.start_time
    assert set(first) == set(RECORDED) - SILENT
    for name, stamp in first.items():
        assert stamp - begin <= 100_000_000, f"{name} begins late"


def test_fast_topics_have_no_hole(bag: Path, recorded_run: Any) -> None:
    stamps: dict[str, list[int]] = {
        "/winding/rig/joint_states": [],
        "/winding/camera/image_raw": [],
    }
    with AnyReader([bag]) as reader:
        wanted = [c for c in reader.connections if c.topic in stamps]
        for connection, _, data in reader.messages(wanted):
            header = reader.deserialize(data, connection.msgtype).header
            stamps[connection.topic].append(header.stamp.sec * 10**9 + header.stamp.nanosec)
    end = int(recorded_run.duration * 10**9)
    assert stamps["/winding/rig/joint_states"] == list(range(0, end + 1, 10**6))
    assert stamps["/winding/camera/image_raw"] == list(range(0, end + 1, 5 * 10**6))


def test_mcap_reader_decodes_every_message(bag: Path) -> None:
    (file,) = bag.glob("*.mcap")
    counted: Counter[str] = Counter()
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            counted[channel.topic] += 1
            if channel.topic == "/winding/camera/image_raw":
                assert (message.width, message.height, message.encoding) == (640, 96, "bgr8")
    assert set(counted) == set(RECORDED) - SILENT


def test_metadata_is_rosbag2_version_nine(bag: Path) -> None:
    text = (bag / "metadata.yaml").read_text(encoding="utf-8")
    information = yaml.safe_load(text)["rosbag2_bagfile_information"]
    assert information["version"] == 9
    assert information["storage_identifier"] == "mcap"
    counts = {
        item["topic_metadata"]["name"]: item["message_count"]
        for item in information["topics_with_message_count"]
    }
    assert set(counts) == set(RECORDED)


def test_latched_topics_are_offered_as_transient_local(bag: Path) -> None:
    with AnyReader([bag]) as reader:
        for connection in reader.connections:
            (qos,) = connection.ext.offered_qos_profiles
            latched = RECORDED[connection.topic].latched
            assert (qos.durability.name == "TRANSIENT_LOCAL") is latched
