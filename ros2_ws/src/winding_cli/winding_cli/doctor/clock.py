"""The machine's clocks."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from winding_cli.doctor.finding import Finding, fail, ok, warn

_FINE = 1.0e-6
# The machine's samples are a millisecond apart.
_COARSE = 1.0e-3
# A frame every five milliseconds: latencies are differences of two clocks.
_JUMP = 5.0e-3
# A file may have been written by a machine whose clock was a little ahead [s].
_AHEAD = 60.0


@dataclass(frozen=True, kw_only=True)
class ClockPair:
    """One reading of both clocks.

    Attributes:
        monotonic: Monotonic time [s].
        wall: Time of day [s].
        width: Monotonic time that the reading took [s].
    """

    monotonic: float
    wall: float
    width: float


def read_clocks(monotonic: Callable[[], float], wall: Callable[[], float]) -> ClockPair:
    """Read the wall clock between two readings of the monotonic one."""
    before = monotonic()
    now = wall()
    after = monotonic()
    return ClockPair(monotonic=0.5 * (before + after), wall=now, width=after - before)


def judge_resolution(resolution: float) -> Finding:
    """Return whether the monotonic clock's resolution [s] serves a machine of 1 kHz."""
    found = f"{1e9 * resolution:.0f} ns"
    if resolution <= _FINE:
        return ok("clock resolution", found)
    advice = "choose another clock source, such as tsc or hpet"
    judge = fail if resolution > _COARSE else warn
    return judge("clock resolution", found, advice)


def judge_date(wall: float, newest: float) -> Finding:
    """Return whether the time of day is later than what is installed.

    Args:
        wall: Time of day [s].
        newest: When the newest installed file was written [s].
    """
    lag = newest - wall
    if lag <= _AHEAD:
        return ok("time of day", "later than everything that is installed")
    return warn(
        "time of day",
        f"{lag / 3600.0:.1f} h before the newest installed file",
        "set the clock; names of runs and dates of logs come from it",
    )


def judge_jumps(pairs: Iterable[ClockPair]) -> Finding:
    """Return whether the wall clock ran beside the monotonic one in a row of readings."""
    readings = list(pairs)
    first = readings[0]
    span = readings[-1].monotonic - first.monotonic
    # What the readings themselves cannot tell from a jump is none.
    drifts = [
        max(
            abs((pair.wall - first.wall) - (pair.monotonic - first.monotonic))
            - 0.5 * (pair.width + first.width),
            0.0,
        )
        for pair in readings
    ]
    found = f"{1e3 * max(drifts):.3f} ms apart over {span:.2f} s"
    if max(drifts) <= _JUMP:
        return ok("clock jumps", found)
    return warn(
        "clock jumps",
        found,
        "something sets the clock; let it slew (chronyd), or latencies in /diagnostics are wrong",
    )


def judge_synchronisation(answer: str | None) -> Finding:
    """Return whether the clock follows a time server.

    Args:
        answer: `yes` or `no` of timedatectl; None when it cannot tell.
    """
    check = "time server"
    if answer is None:
        return ok(check, "timedatectl cannot tell; one machine needs none")
    if answer == "yes":
        return ok(check, "the clock is synchronised")
    return warn(
        check,
        "the clock is not synchronised",
        "timedatectl set-ntp true, if records of several machines are to be compared",
    )
