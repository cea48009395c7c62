"""Disk and limits, each in the condition that is looked for."""

import time
from pathlib import Path

from winding_cli.doctor import host
from winding_cli.doctor.finding import Level


def test_disk_without_room_for_a_run_is_a_failure(small_disk: Path) -> None:
    found = host.judge_disk(small_disk, time.monotonic)
    assert [(f.check, f.level) for f in found] == [
        ("disk space", Level.FAIL),
        ("disk speed", Level.FAIL),
    ]
    assert all("No space left" in f.found for f in found)


def test_space_is_given_as_time_of_recording() -> None:
    found = [
        host.judge_space(Path("here"), int(seconds * host.RECORDED_PER_SECOND))
        for seconds in (19.0, 21.0, 3601.0)
    ]
    assert [f.level for f in found] == [Level.FAIL, Level.WARN, Level.OK]
    assert "19 s of recording" in found[0].found
    assert "60 min of recording" in found[2].found


def test_written_bytes_reach_the_disk_and_go_again(tmp_path: Path) -> None:
    readings = iter((10.0, 10.5))
    _, speed = host.judge_disk(tmp_path, lambda: next(readings), size=1_000_000)
    assert speed.found.startswith("2 MB/s written and synced")
    assert list(tmp_path.iterdir()) == []


def test_slow_disk_is_a_warning() -> None:
    assert host.judge_speed(host.RECORDED_PER_SECOND).level is Level.OK
    slow = host.judge_speed(5.0e6)
    assert slow.level is Level.WARN
    assert slow.found.startswith("5 MB/s written and synced")


def test_processors_memory_and_limits_are_held_against_what_a_run_takes() -> None:
    assert host.judge_processors(2, 1.9).level is Level.OK
    assert host.judge_processors(2, 2.1).level is Level.WARN
    assert host.judge_processors(1, 0.0).level is Level.WARN
    assert host.judge_memory(3.0e9).level is Level.OK
    assert host.judge_memory(1.0e9).level is Level.WARN
    levels = [host.judge_open_files(limit).level for limit in (50, 100, 1024)]
    assert levels == [Level.FAIL, Level.WARN, Level.OK]
    buffers = [host.judge_receive_buffer(limit).level for limit in (None, 65_536, 212_992)]
    assert buffers == [Level.OK, Level.WARN, Level.OK]
