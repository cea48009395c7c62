"""Clocks, disk and limits of the host, each in the condition that is looked for."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from winding_cli.doctor import host
from winding_cli.doctor.finding import Finding, Level
from winding_cli.doctor.host import ClockPair, judge_jumps, read_clocks


def readings(jump: float, width: float = 0.0) -> Iterator[ClockPair]:
    """Yield readings every 10 ms; the wall clock jumps by `jump` seconds in the middle."""
    for k in range(20):
        t = 100.0 + 0.01 * k
        yield ClockPair(monotonic=t, wall=1.7e9 + t + (jump if k >= 10 else 0.0), width=width)


def test_clocks_that_run_together_do_not_jump() -> None:
    assert judge_jumps(readings(0.0)).level is Level.OK


@pytest.mark.parametrize("jump", [-3600.0, -0.02, 0.02, 5.0])
def test_clock_that_is_set_is_found_with_the_size_of_the_jump(jump: float) -> None:
    found = judge_jumps(readings(jump))
    assert found.level is Level.WARN
    assert float(found.found.split(" ms")[0]) == pytest.approx(1e3 * abs(jump), abs=0.01)


def test_reading_that_took_long_is_no_jump() -> None:
    """A process that gets no processor between two clocks sees them apart by as much."""
    assert judge_jumps(readings(0.02, width=0.04)).level is Level.OK


def test_reading_lies_in_the_middle_of_its_width() -> None:
    monotonic = iter((10.0, 10.5))
    pair = read_clocks(lambda: next(monotonic), lambda: 7.0)
    assert pair == ClockPair(monotonic=10.25, wall=7.0, width=0.5)
    own = read_clocks(time.monotonic, time.time)
    assert own.width >= 0.0


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


OK, WARN, FAIL = Level.OK, Level.WARN, Level.FAIL


@pytest.mark.parametrize(
    ("finding", "level", "found"),
    [
        (host.judge_resolution(1e-9), OK, "1 ns"),
        (host.judge_resolution(1e-4), WARN, ""),
        (host.judge_resolution(4e-3), FAIL, ""),
        (host.judge_date(1.7e9, 1.6e9), OK, ""),
        (host.judge_date(0.0, 7200.0), WARN, "2.0 h before the newest installed file"),
        (host.judge_synchronisation(None), OK, ""),
        (host.judge_synchronisation("yes"), OK, ""),
        (host.judge_synchronisation("no"), WARN, ""),
        (host.judge_speed(host.RECORDED_PER_SECOND), OK, ""),
        (host.judge_speed(5.0e6), WARN, "5 MB/s written and synced"),
        (host.judge_processors(2, 1.9), OK, ""),
        (host.judge_processors(2, 2.1), WARN, ""),
        (host.judge_processors(1, 0.0), WARN, ""),
        (host.judge_memory(3.0e9), OK, ""),
        (host.judge_memory(1.0e9), WARN, ""),
        (host.judge_open_files(50), FAIL, ""),
        (host.judge_open_files(100), WARN, ""),
        (host.judge_open_files(1024), OK, ""),
        (host.judge_receive_buffer(None), OK, ""),
        (host.judge_receive_buffer(65_536), WARN, ""),
        (host.judge_receive_buffer(212_992), OK, ""),
    ],
)
def test_the_host_is_held_against_what_a_run_takes(
    finding: Finding, level: Level, found: str
) -> None:
    assert finding.level is level
    assert finding.found.startswith(found)
    assert bool(finding.advice) is (level is not OK)
