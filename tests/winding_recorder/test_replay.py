"""Process replay: the same inputs give the same answers, whatever order they arrived in."""

import json
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from made_bags import channel_of, storage_file

from cable_fem_node.ros.message_handler import FemHandler
from cable_fem_node.ros.parameters import FemParameters
from processes import COMMAND, ran
from winding_core.markers import MARKER_DTYPE
from winding_recorder.bags.description import PARAMETERS, BagError, StoredMessage
from winding_recorder.bags.mcap_file import BagConfig
from winding_recorder.bags.reading import Decoder
from winding_recorder.bags.writer import BagWriter
from winding_recorder.playback.replay import replay
from winding_ros import graph, topics
from winding_ros.messages.clouds import decode_cloud, encode_cloud
from winding_ros.messages.rig import encode_joint_state, encode_tension
from winding_ros.messages.stamps import serialised_stamp_ns, stamp_bytes, with_stamp
from winding_ros.topic import Topic

PARAMETERS_OF_RUN = {"case": 4, "duration": 0.3}
SAMPLES = 300
RECORDED = (*graph.FEM.inputs, *graph.FEM.outputs)


def inputs(reading_at: Any) -> Iterator[tuple[Topic, int, Any]]:
    """Joint states at 1 kHz and a tension that changes, in the order they are published."""
    for sample in range(SAMPLES):
        t = sample * 1e-3
        yield topics.JOINT_STATES, sample, encode_joint_state(t, reading_at(t))
        if sample % 10 == 0:
            yield topics.TENSION, sample, encode_tension(t, 2.0 + 0.01 * (sample % 70))


def record(
    folder: Path, arrivals: list[tuple[Topic, Any]], *, harm: float = 0.0, began: int | None = None
) -> Path:
    """Record what the solver's work answers to messages that arrive in some order.

    Bag times are arrivals, one each 0.1 ms from `began` [ns] on; stamps as in older recordings
    where that is None.
    """
    channels = [*map(channel_of, RECORDED)]
    notes = {f"{PARAMETERS}{topics.FEM}": json.dumps(PARAMETERS_OF_RUN)}
    writer = BagWriter(folder, channels, BagConfig(), notes)
    decoder = Decoder()

    def write(topic: Topic, data: bytes) -> None:
        if topic is topics.FEM_MARKERS and harm:
            _, markers = decode_cloud(data, MARKER_DTYPE)
            markers["theta"][0] = harm
            data = with_stamp(encode_cloud(0.0, markers), stamp_bytes(data))
        data = decoder.canonical(topic.type_name, data)
        stamp = serialised_stamp_ns(data)
        arrived = stamp if began is None else began + 100_000 * writer.taken
        writer.write(RECORDED.index(topic), StoredMessage(data, arrived, stamp))

    handler = FemHandler(FemParameters(**PARAMETERS_OF_RUN))
    for answer in handler.begin(0.0):
        write(answer.topic, answer.data)
    for topic, message in arrivals:
        write(topic, message)
        for answer in handler.take(topic, message):
            write(answer.topic, answer.data)
    writer.close()
    return folder


@pytest.fixture(scope="module")
def in_order(bags: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    arrivals = [(topic, message) for topic, _, message in inputs(bags.reading_at)]
    return record(tmp_path_factory.mktemp("fem") / "bag", arrivals)


def test_a_replay_gives_the_recorded_bytes(in_order: Path) -> None:
    result = replay(in_order, "fem")
    assert result.agrees
    assert result.inputs == SAMPLES + SAMPLES // 10
    assert sum(comparison.compared for comparison in result.comparisons) == 15 + 2 * 6 + 1
    assert all(c.identical == c.compared for c in result.comparisons)


@pytest.mark.parametrize("late", [13, 90], ids=["tension 13 ms late", "tension 90 ms late"])
def test_answers_do_not_depend_on_the_order_of_arrival(
    bags: Any, in_order: Path, tmp_path: Path, late: int
) -> None:
    delayed = sorted(
        inputs(bags.reading_at),
        key=lambda item: item[1] + (late if item[0] is topics.TENSION else 0),
    )
    in_time = [(topic, message) for topic, _, message in delayed]
    other = replay(record(tmp_path / "bag", in_time, began=1_764_000_000 * 10**9), "fem")
    # The last samples still waited for their tension when the recording ended.
    assert other.comparisons
    assert all(comparison.missing == 0 for comparison in other.comparisons)
    assert all(comparison.identical == comparison.compared for comparison in other.comparisons)
    assert other.digest == replay(in_order, "fem").digest


def test_a_message_of_another_time_holds_none_up(bags: Any, in_order: Path, tmp_path: Path) -> None:
    arrivals = [(topic, message) for topic, _, message in inputs(bags.reading_at)]
    future = encode_tension(5000.0, 2.2)
    arrivals.insert(120, (topics.TENSION, future))
    answered = replay(in_order, "fem")
    bag = record(tmp_path / "bag", arrivals, began=10**18)
    other = replay(bag, "fem")
    assert other.inputs == answered.inputs + 1
    assert other.digest == answered.digest


def test_a_damaged_recording_is_refused(bags: Any, in_order: Path, tmp_path: Path) -> None:
    """A database has no checksums: what is flipped reaches the replay."""
    folder = bags.as_sqlite(in_order, tmp_path / "bag")
    file = storage_file(folder)
    whole, rng = file.read_bytes(), random.Random(29)
    refused = []
    for _ in range(12):
        spoiled = bytearray(whole)
        for _ in range(300):
            spoiled[rng.randrange(4096, len(spoiled))] ^= 1 << rng.randrange(8)
        file.write_bytes(spoiled)
        try:
            replay(folder, "fem", parameters=PARAMETERS_OF_RUN)
        except BagError as error:
            refused.append(str(error))
    assert refused
    assert all(sentence and "\n" not in sentence for sentence in refused)


@pytest.mark.slow
def test_two_replays_in_two_processes_are_byte_identical(in_order: Path) -> None:
    def digest() -> str:
        words = (*COMMAND, "bag", "replay", in_order, "--node", "fem")
        return ran(*words, check=True, timeout=120).stdout.splitlines()[0]

    assert digest() == digest()


def test_a_changed_answer_is_a_difference_with_its_field(bags: Any, tmp_path: Path) -> None:
    arrivals = [(topic, message) for topic, _, message in inputs(bags.reading_at)]
    result = replay(record(tmp_path / "bag", arrivals, harm=1e-3), "fem")
    assert not result.agrees
    (markers,) = (c for c in result.comparisons if c.topic == "/winding/fem/markers")
    assert markers.differences["theta"] == 1e-3
    assert markers.excess["theta"] > 1.0


@pytest.mark.parametrize(
    ("node", "sentence"),
    [
        ("rig", "node must be one of tracker, fem, correction, got 'rig'"),
        ("tracker", "does not say with what parameters marker_tracker ran; give --parameters"),
    ],
)
def test_what_cannot_be_replayed_is_refused(in_order: Path, node: str, sentence: str) -> None:
    with pytest.raises(BagError, match=sentence):
        replay(in_order, node)


def test_a_recording_without_the_topic_is_refused(made: Path) -> None:
    with pytest.raises(BagError, match="must hold tracker/markers once, it holds 0 of it"):
        replay(made, "correction", parameters={"case": 4})
