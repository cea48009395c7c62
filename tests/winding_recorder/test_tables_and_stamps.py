"""Recordings as tables; losses, rhythm and pacing as numbers; what a long run keeps."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.csv
import pyarrow.parquet
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_bags import READING, channel_of
from rclpy.serialization import serialize_message
from sensor_msgs.msg import PointCloud2

from winding_core.history import History
from winding_recorder.bags.check import check, rhythm, stamp_findings
from winding_recorder.bags.description import (
    COMPLETE,
    LOST,
    YES,
    BagError,
    StoredMessage,
    jazzy_channel,
)
from winding_recorder.bags.mcap_file import BagConfig
from winding_recorder.bags.tables import export
from winding_recorder.bags.writer import BagWriter
from winding_recorder.live.bag_series import LossCount
from winding_recorder.live.run_buffer import BufferedMessage, RunBuffer, StampRuns
from winding_recorder.playback.player import Pacing
from winding_ros import topics
from winding_ros.messages.diagnostics import encode_case_votes
from winding_ros.messages.rig import encode_joint_state

MS = 1_000_000


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_joint_states_become_columns_by_joint(made: Path, tmp_path: Path, form: str) -> None:
    files = export(made, tmp_path / "tables", form)
    assert sorted(file.name for file in files) == [
        f"winding.camera.image_raw.{form}",
        f"winding.rig.joint_states.{form}",
        f"winding.rig.tension.{form}",
    ]
    file = tmp_path / "tables" / f"winding.rig.joint_states.{form}"
    read = pyarrow.csv.read_csv if form == "csv" else pyarrow.parquet.read_table
    table = read(file)
    np.testing.assert_allclose(table["t"], np.arange(600) * 1e-3, atol=1e-12)
    assert table.column_names[1:3] == ["cylinder_joint.position", "carriage_joint.position"]
    # The drive ramps to 1.74 rad/s within one second.
    assert table["cylinder_joint.velocity"][500].as_py() == pytest.approx(0.87, rel=1e-9)


def test_stamp_and_arrival_stand_side_by_side(bags: Any, tmp_path: Path) -> None:
    folder = bags.whole(tmp_path / "bag", 40, began=1_700_000_000_000_000_000)
    files = export(folder, tmp_path / "t", "parquet", frozenset({"/winding/rig/tension"}))
    table = pyarrow.parquet.read_table(files[0])
    np.testing.assert_allclose(table["t"], [0.0, 0.01, 0.02, 0.03], atol=1e-12)
    # Seconds since the epoch are carried to 0.2 us.
    np.testing.assert_allclose(np.array(table["arrival"]) - 1.7e9, table["t"], atol=1e-6)


def test_pictures_leave_their_pixels_in_the_bag(made: Path, tmp_path: Path) -> None:
    (file,) = export(made, tmp_path / "t", "csv", frozenset({"/winding/camera/image_raw"}))
    table = pyarrow.csv.read_csv(file)
    assert "data" not in table.column_names
    assert set(table["width"].to_pylist()) == {96}


def test_an_unknown_topic_is_named_with_those_there_are(made: Path, tmp_path: Path) -> None:
    with pytest.raises(BagError, match="has no topic /x; it has /winding/camera/image_raw"):
        export(made, tmp_path / "tables", "csv", frozenset({"/x"}))
    assert not (tmp_path / "tables").exists()


def test_tables_are_never_written_over_others(made: Path, tmp_path: Path) -> None:
    with pytest.raises(BagError, match="exists already"):
        export(made, tmp_path, "csv")


@given(kept=st.lists(st.booleans(), min_size=1, max_size=200))
def test_every_number_that_is_missing_in_between_is_lost(kept: list[bool]) -> None:
    numbers = [number for number, there in enumerate(kept, 1) if there]
    count = LossCount()
    for number in numbers:
        count.take(number)
    assert count.received == len(numbers)
    if numbers:
        # What was published before the first that arrived is not known to be lost.
        assert numbers[0] - 1 + count.received + count.lost == numbers[-1]


def test_a_publisher_that_starts_again_has_lost_nothing() -> None:
    count = LossCount()
    for number in (1, 2, 3, 1, 2):
        count.take(number)
    assert (count.lost, count.received) == (0, 5)


def test_numbers_of_two_publishers_are_counted_apart() -> None:
    count = LossCount()
    for k in range(50):
        for number in (5000 + k, 1 + k):
            # The first publisher loses two messages, the second one.
            if number not in (5010, 5011, 30):
                count.take(number)
    assert (count.lost, count.received) == (3, 97)


def test_a_steady_topic_has_a_rhythm_and_no_gap() -> None:
    stamps = np.arange(100, dtype=np.int64) * 5 * MS
    assert rhythm(stamps) == 5 * MS
    assert stamp_findings("/t", stamps, ordered=True) == []


def test_a_topic_sent_on_change_has_no_rhythm_and_so_no_gap() -> None:
    stamps = np.cumsum(np.random.default_rng(1).integers(1, 1000, 100)).astype(np.int64) * MS
    assert rhythm(stamps) is None
    assert stamp_findings("/t", stamps, ordered=True) == []


def test_several_publishers_may_step_back() -> None:
    stamps = np.array([0, 10, 5, 20], dtype=np.int64) * MS
    assert stamp_findings("/diagnostics", stamps, ordered=False) == []


def test_rate_stretches_the_wall_clock() -> None:
    pacing = Pacing(0.5)
    pacing.start(100.0, 10.0)
    assert pacing.wait(101.0, 10.0) == 2.0
    assert pacing.wait(101.0, 11.0) == 1.0
    assert pacing.wait(101.0, 13.0) == 0.0


def test_a_pause_takes_no_bag_time() -> None:
    pacing = Pacing(2.0)
    pacing.start(0.0, 0.0)
    pacing.set_paused(True, 1.0)
    assert pacing.bag_time(500.0) == 2.0
    assert pacing.wait(2.0, 500.0) is None
    pacing.set_paused(False, 500.0)
    assert pacing.wait(2.0, 500.0) == 0.0
    assert pacing.wait(4.0, 500.0) == 1.0


def test_a_rate_that_leads_nowhere_is_refused() -> None:
    for rate in [0.0, -1.0, float("nan"), float("inf")]:
        with pytest.raises(ValueError, match="rate must be positive and finite"):
            Pacing(rate)


def test_a_cloud_that_contradicts_itself_is_refused(bags: Any, tmp_path: Path) -> None:
    cloud = PointCloud2(height=1, width=5, point_step=8, row_step=40)
    channel = jazzy_channel("/c", "sensor_msgs/msg/PointCloud2", depth=1, latched=False)
    writer = BagWriter(tmp_path / "bag", [channel], BagConfig())
    writer.write(0, StoredMessage(bytes(serialize_message(cloud)), 0, 0))
    writer.close()
    with pytest.raises(BagError, match="contradicts itself"):
        export(tmp_path / "bag", tmp_path / "tables", "csv")


def filled(count: int, *, newest: int = 10, older: int = 30) -> History[int]:
    reel: History[int] = History(newest=newest, older=older)
    for item in range(count):
        reel.append(item)
    return reel


def test_a_short_run_is_there_as_a_whole() -> None:
    for count in [0, 1, 9, 20, 45]:
        reel = filled(count)
        assert list(reel) == list(range(count))
        assert (len(reel), reel.taken, reel.stride) == (count, count, 1)


def test_a_long_run_is_covered_evenly_from_its_start_in_bounded_memory() -> None:
    for count in [51, 1000, 12_345]:
        reel = filled(count)
        assert len(reel) <= 2 * 10 + 30
        assert reel.taken == count
        items = list(reel)
        assert items[-10:] == list(range(count - 10, count))
        older = [item for item in items if item % reel.stride == 0 and item < count - 20]
        assert older == list(range(0, older[-1] + 1, reel.stride))
        assert len(older) > 30 // 2 - 1


def test_a_reel_reads_like_a_list() -> None:
    reel = filled(100)
    items = list(reel)
    assert (reel[-1], reel[0], reel[2:5]) == (99, 0, items[2:5])
    assert list(reversed(reel)) == items[::-1]
    assert reel.newest(3) == [97, 98, 99]
    assert reel.newest(0) == []
    with pytest.raises(IndexError):
        reel[len(items)]


def test_what_is_held_does_not_depend_on_when_one_looks() -> None:
    """A reader has what was there when it began to read."""
    reel = filled(19)
    reading = iter(reel)
    for item in range(19, 500):
        reel.append(item)
    assert list(reading) == list(range(19))


def test_steady_stamps_take_no_memory_and_none_is_lost() -> None:
    came = [k * 5 for k in range(1000) if k not in (0, 17, 18, 500)] + [3, 8, 13]
    runs = StampRuns(5)
    for stamp in came:
        runs.add(stamp)
    assert runs.stamps().tolist() == came
    assert len(runs._first) == 4
    assert StampRuns(5).stamps().tolist() == []


@pytest.mark.slow
def test_a_tape_keeps_forty_seconds_whole_and_every_stamp_of_more() -> None:
    buffer = RunBuffer([topics.TENSION, topics.IMAGE, topics.DIAGNOSTICS])
    for k in range(39 * 100):
        buffer.add(topics.TENSION, BufferedMessage(k * 10**7, 0, 0, b""))
    assert len(buffer.messages[topics.TENSION.name]) == 3900
    assert not buffer.thinned
    for k in range(3900, 180_000):
        buffer.add(topics.TENSION, BufferedMessage(k * 10**7, 0, 0, b""))
    assert buffer.thinned
    assert len(buffer.messages[topics.TENSION.name]) <= 4000
    assert (buffer.stamps(topics.TENSION) == np.arange(180_000) * 10**7).all()
    assert buffer.last_stamp(topics.TENSION) == pytest.approx(1799.99)


def test_pictures_are_left_to_the_bag() -> None:
    buffer = RunBuffer([topics.IMAGE])
    buffer.add(topics.IMAGE, BufferedMessage(stamp_ns=1, sent_ns=0, received_ns=0, data=b"picture"))
    assert buffer.messages == {}
    assert buffer.last(topics.IMAGE) is None


@pytest.mark.parametrize("invalid", [0, 1, 70])
def test_the_newest_axis_reading_is_the_last_usable_one(invalid: int) -> None:
    buffer = RunBuffer([topics.JOINT_STATES])
    for sample in range(100 + invalid):
        stamp = sample * MS
        data = bytes(encode_joint_state(1e-3 * sample, READING))
        if sample >= 100:
            data = data[: len(data) // 2]
        buffer.add(topics.JOINT_STATES, BufferedMessage(stamp, stamp, stamp, data))
    assert buffer.newest_axis_reading()[0] == pytest.approx(0.099)


@pytest.mark.parametrize("times", [(6, 3, 4), (6, 3, 2)])
def test_only_a_latched_message_from_before_a_bag_may_be_of_a_later_time(
    times: tuple[int, ...], tmp_path: Path
) -> None:
    channel = channel_of(topics.CORRECTION_CASE)
    writer = BagWriter(tmp_path / "bag", [channel], BagConfig())
    for arrived, t in enumerate(times):
        data = serialize_message(encode_case_votes(t, {}))
        writer.write(0, StoredMessage(data, arrived, t * 10**9))
    writer.close({COMPLETE: YES, f"{LOST}{channel.name}": "0"})
    found = f"{channel.name}: time goes back 1 times, first after 3.000000 s"
    assert check(tmp_path / "bag").findings == ([found] if times[-1] < 3 else [])
