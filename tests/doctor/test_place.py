"""Shared memory, disk and limits, each in the condition that is looked for."""

import fcntl
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

import winding_bringup
from winding_bringup.doctor import capacity, disk, shared_memory
from winding_bringup.doctor.finding import Finding, Level
from winding_bringup.graph import GRAPH

SEGMENT = "fastrtps_0123456789abcdef"
HOLD_A_LOCK = """
import fcntl, sys
file = open(sys.argv[1], "rb")
fcntl.flock(file, fcntl.LOCK_EX)
print("held", flush=True)
sys.stdin.read()
"""


def shared(folder: Path) -> tuple[Finding, Finding]:
    room, left = shared_memory.judge_shared_memory(folder, shared_memory.look(folder))
    return room, left


def test_no_shared_memory_is_a_failure_with_its_remedy(tmp_path: Path) -> None:
    room, _ = shared(tmp_path / "shm")
    assert room.level is Level.FAIL
    assert room.found == f"there is no {tmp_path}/shm"
    assert room.advice.startswith("mount a tmpfs")


def test_shared_memory_of_a_small_container_is_a_warning(small_disk: Path) -> None:
    room, _ = shared(small_disk)
    assert room.level is Level.WARN
    assert "1 MB free" in room.found
    assert "--shm-size" in room.advice


def test_full_shared_memory_takes_nothing(small_disk: Path) -> None:
    with pytest.raises(OSError, match="No space left"):
        (small_disk / "full").write_bytes(bytes(2_000_000))
    room, _ = shared(small_disk)
    assert room.level is Level.FAIL
    assert "No space left on device" in room.found


def test_look_leaves_nothing_behind(tmp_path: Path) -> None:
    shared_memory.look(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_segment_of_a_killed_process_is_left_over_and_that_of_a_living_one_is_not(
    tmp_path: Path,
) -> None:
    (tmp_path / SEGMENT).write_bytes(bytes(3_000_000))
    lock = tmp_path / f"{SEGMENT}_el"
    lock.touch()
    with subprocess.Popen(
        [sys.executable, "-c", HOLD_A_LOCK, str(lock)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as owner:
        assert owner.stdout is not None
        assert owner.stdout.readline() == b"held\n"
        assert shared(tmp_path)[1].level is Level.OK
        owner.kill()
        owner.wait()
    _, left = shared(tmp_path)
    assert left.level is Level.WARN
    assert left.found == "1 files of dead processes, 3.0 MB"
    assert "fastdds shm clean" in left.advice
    # A look holds no lock itself.
    with lock.open("rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


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


def test_room_for_shared_memory_is_what_the_profiles_ask_for() -> None:
    """One process has the camera's segment, every other one a node's."""
    profiles = Path(winding_bringup.__file__).parent / "profiles"
    sizes = {
        name: int(re.findall(r"<segment_size>(\d+)<", (profiles / f"{name}.xml").read_text())[0])
        for name in ("camera", "node")
    }
    segments = sizes["camera"] + len(GRAPH) * sizes["node"]
    assert segments < shared_memory.NEEDED < 2 * segments
