"""A run of real processes: its bag is whole, nothing was lost, and its nodes' work repeats."""

import shutil
from collections import Counter, defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from winding_recorder.bags.check import check
from winding_recorder.bags.contents import contents
from winding_recorder.bags.reading import opened, stamped_messages
from winding_recorder.playback.replay import replay
from winding_ros import topics

pytestmark = pytest.mark.processes


RECORDED = {
    (topic.name if topic.name.startswith("/") else f"/winding/{topic.name}"): topic
    for topic in topics.TOPICS
    if topic.recorded
}

_LONG_AGO = 1_700_000_000 * 10**9  # Arrivals are dates: of after 2023 [ns]
# This run is not commanded from outside, and no lay is controlled in it.
SILENT = {
    name
    for name, topic in RECORDED.items()
    if topic.publisher in (topics.COMMANDER, topics.LAY_CONTROL)
}


@pytest.fixture(scope="module")
def bag(recorded_run: Any) -> Path:
    return recorded_run.bag


def test_nothing_was_lost_and_every_checksum_holds(bag: Path) -> None:
    assert check(bag).findings == []
    counted = {topic.name: topic.lost for topic in contents(bag).topics}
    assert set(counted.values()) == {0, None}
    # Losses cannot be counted where several nodes publish, or external ones do.
    commands = {f"/winding/{topic.name}" for topic in topics.published_by(topics.COMMANDER)}
    uncounted = {name for name, lost in counted.items() if lost is None}
    assert uncounted == {"/diagnostics"} | commands


def test_the_correction_s_answers_come_again_byte_for_byte(bag: Path) -> None:
    result = replay(bag, "correction")
    assert result.agrees
    assert result.comparisons
    assert all(c.identical == c.compared > 0 for c in result.comparisons)


def test_the_solver_s_answers_come_again(bag: Path) -> None:
    # Tension that arrives more than 0.2 s late, as on a machine with ten times its load, would
    # be used late in the run and in time in the replay.
    result = replay(bag, "fem")
    assert result.agrees, result.comparisons
    assert result.comparisons
    assert all(c.compared > 0 for c in result.comparisons)


def test_the_tracker_s_frames_come_again(bag: Path) -> None:
    result = replay(bag, "tracker")
    assert result.refused == 0
    compared = {item.topic: item for item in result.comparisons}
    markers = compared[f"/winding/{topics.TRACKED_MARKERS.name}"]
    # In the run a frame may have gone without an encoder sample that came too late; in the
    # replay none does.
    assert markers.missing == 0
    assert markers.compared > 900
    assert result.digest == replay(bag, "tracker").digest


def test_the_report_of_a_bag_names_every_topic(bag: Path, command: Callable[..., Any]) -> None:
    shown = command("bag", "info", bag, cwd=bag.parent, code=0)
    assert "complete: yes" in shown.stdout
    for topic in topics.TOPICS:
        assert (topic.name in shown.stdout) is topic.recorded


def test_damage_ends_the_check_with_exit_code_one(bag: Path, command: Any, tmp_path: Path) -> None:
    assert "is whole: " in command("bag", "check", bag, cwd=tmp_path, code=0).stdout
    harmed = Path(shutil.copytree(bag, tmp_path / "bag"))
    (file,) = harmed.glob("*.mcap")
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 4
    file.write_bytes(content)
    found = command("bag", "check", harmed, cwd=tmp_path, code=1).stdout.splitlines()
    assert found
    assert all(line.startswith("found: ") for line in found)
    recovered = command("bag", "recover", harmed, tmp_path / "out", cwd=tmp_path, code=0)
    assert "lost: " in recovered.stdout


@pytest.mark.parametrize("action", ["info", "check", "replay", "play"])
def test_folder_that_is_no_recording_is_refused(command: Any, tmp_path: Path, action: str) -> None:
    options = ["--node", "fem", "--parameters", "p.yaml"] if action == "replay" else []
    (tmp_path / "p.yaml").write_text("{}")
    refused = command("bag", action, tmp_path, *options, cwd=tmp_path, code=1)
    assert len(refused.stderr.strip().splitlines()) == 1
    assert "winding: " in refused.stderr


@pytest.mark.parametrize("action", ["info", "check", "replay", "play", "export", "recover"])
def test_an_absent_recording_is_no_command(command: Any, tmp_path: Path, action: str) -> None:
    options = {"replay": ["--node", "fem"], "export": ["--output", "t"], "recover": ["new"]}
    refused = command("bag", action, "missing", *options.get(action, []), cwd=tmp_path, code=2)
    assert refused.stderr.strip() == "winding: there is no recording at missing"


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
    arrivals: dict[str, list[int]] = defaultdict(list)
    with opened(bag) as reader:
        for link, stamp, arrived, _ in stamped_messages(reader, list(reader.connections)):
            first.setdefault(link.topic, stamp)
            arrivals[link.topic].append(arrived)
    assert set(first) == set(RECORDED) - SILENT
    for name, stamp in first.items():
        # The machine's time begins at zero.
        assert stamp <= 100_000_000, f"{name} begins late"
        assert arrivals[name][0] >= _LONG_AGO


def test_mcap_reader_decodes_every_message(bag: Path) -> None:
    (file,) = bag.glob("*.mcap")
    counted: Counter[str] = Counter()
    with file.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
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
    assert {name for name, count in counts.items() if count == 0} == SILENT


def test_latched_topics_are_offered_as_transient_local(bag: Path) -> None:
    with AnyReader([bag]) as reader:
        assert reader.connections
        for connection in reader.connections:
            (qos,) = connection.ext.offered_qos_profiles
            latched = RECORDED[connection.topic].latched
            assert (qos.durability.name == "TRANSIENT_LOCAL") is latched
