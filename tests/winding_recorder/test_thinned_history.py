"""What the buffer of a long run holds: the end whole, the rest thinned evenly, every stamp."""

import numpy as np
import pytest

from winding_core.history import History
from winding_recorder.live.run_buffer import BufferedMessage, RunBuffer, StampRuns
from winding_ros import topics


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
        buffer.add(
            topics.TENSION, BufferedMessage(stamp_ns=k * 10**7, sent_ns=0, received_ns=0, data=b"")
        )
    assert len(buffer.messages[topics.TENSION.name]) == 3900
    assert not buffer.thinned
    for k in range(3900, 180_000):
        buffer.add(
            topics.TENSION, BufferedMessage(stamp_ns=k * 10**7, sent_ns=0, received_ns=0, data=b"")
        )
    assert buffer.thinned
    assert len(buffer.messages[topics.TENSION.name]) <= 4000
    assert (buffer.stamps(topics.TENSION) == np.arange(180_000) * 10**7).all()
    assert buffer.last_stamp(topics.TENSION) == pytest.approx(1799.99)


def test_pictures_are_left_to_the_bag() -> None:
    buffer = RunBuffer([topics.IMAGE])
    buffer.add(topics.IMAGE, BufferedMessage(stamp_ns=1, sent_ns=0, received_ns=0, data=b"picture"))
    assert buffer.messages == {}
    assert buffer.last(topics.IMAGE) is None
