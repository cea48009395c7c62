"""The clocks' findings, with clocks that do what is looked for."""

import time
from collections.abc import Iterator

import pytest

from winding_cli.doctor.finding import Level
from winding_cli.doctor.host import (
    ClockPair,
    judge_date,
    judge_jumps,
    judge_resolution,
    judge_synchronisation,
    read_clocks,
)


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


def test_resolution_is_held_against_the_machine_s_samples() -> None:
    levels = [judge_resolution(r).level for r in (1e-9, 1e-4, 4e-3)]
    assert levels == [Level.OK, Level.WARN, Level.FAIL]


def test_time_of_day_before_the_installation_is_a_warning() -> None:
    assert judge_date(1.7e9, 1.6e9).level is Level.OK
    behind = judge_date(0.0, 7200.0)
    assert behind.level is Level.WARN
    assert behind.found == "2.0 h before the newest installed file"


def test_time_server_is_wanted_only_where_one_can_be_asked_for() -> None:
    levels = [judge_synchronisation(answer).level for answer in (None, "yes", "no")]
    assert levels == [Level.OK, Level.OK, Level.WARN]
