"""Disk and limits, each in the condition that is looked for."""

import time
from pathlib import Path

import pytest

from winding_cli.doctor import capacity, disk
from winding_cli.doctor.finding import Level


def test_disk_without_room_for_a_run_is_a_failure(small_disk: Path) -> None:
    found = disk.judge_space(small_disk, disk.free_space(small_disk))
    assert found.level is Level.FAIL
    assert "0 s of recording" in found.found
    with pytest.raises(OSError, match="No space left"):
        disk.write_speed(small_disk, time.monotonic)


@pytest.mark.parametrize(
    ("seconds", "level"), [(19.0, Level.FAIL), (21.0, Level.WARN), (3601.0, Level.OK)]
)
def test_space_is_told_as_time_of_recording(seconds: float, level: Level) -> None:
    free = int(seconds * disk.RECORDED_PER_SECOND)
    found = disk.judge_space(Path("here"), free)
    assert found.level is level
    assert (f"{seconds:.0f} s of recording" in found.found) is (seconds < 600.0)


def test_written_bytes_reach_the_disk_and_go_again(tmp_path: Path) -> None:
    readings = iter((10.0, 10.5))
    assert disk.write_speed(tmp_path, lambda: next(readings), size=1_000_000) == 2.0e6
    assert list(tmp_path.iterdir()) == []


def test_slow_disk_is_a_warning() -> None:
    assert disk.judge_speed(disk.RECORDED_PER_SECOND).level is Level.OK
    slow = disk.judge_speed(5.0e6)
    assert slow.level is Level.WARN
    assert slow.found.startswith("5 MB/s written and synced")


def test_folder_that_takes_no_file_fails_both_checks_of_the_disk() -> None:
    assert {(f.check, f.level) for f in disk.judge_no_disk("no")} == {
        ("disk space", Level.FAIL),
        ("disk speed", Level.FAIL),
    }


def test_processors_memory_and_limits_are_held_against_what_a_run_takes() -> None:
    assert capacity.judge_processors(2, 1.9).level is Level.OK
    assert capacity.judge_processors(2, 2.1).level is Level.WARN
    assert capacity.judge_processors(1, 0.0).level is Level.WARN
    assert capacity.judge_memory(3.0e9).level is Level.OK
    assert capacity.judge_memory(1.0e9).level is Level.WARN
    levels = [capacity.judge_open_files(limit).level for limit in (50, 100, 1024)]
    assert levels == [Level.FAIL, Level.WARN, Level.OK]
    buffers = [capacity.judge_receive_buffer(limit).level for limit in (None, 65_536, 212_992)]
    assert buffers == [Level.OK, Level.WARN, Level.OK]
