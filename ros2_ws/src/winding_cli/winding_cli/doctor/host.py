"""Clocks, disk, processors, memory and limits of the machine."""

import os
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

from winding_cli.doctor.finding import Finding, fail, judged, ok, warn
from winding_core.units import MILLISECOND

_GIGABYTE, _MEGABYTE = 1.0e9, 1.0e6
_FINE = 1.0e-6
_COARSE = 1.0e-3  # The machine's samples are a millisecond apart
_JUMP = 5.0e-3  # A frame every five milliseconds: latencies are differences of two clocks
_AHEAD = 60.0  # A file may have been written by a machine whose clock was a little ahead [s]
# Measured: 188.2 MB in 5 s and 11.15 GB in 300 s of simulated time, frames of 640 x 96.
RECORDED_PER_SECOND = 38_000_000
_SHORT, _LONG = 20.0, 3600.0
_TRIAL = 8_000_000
# Measured: the graph of a run takes 1.6 of two processors at speed 0, and 1.5 GB.
_PROCESSORS = 2
_MEMORY = 2.0e9
# The orchestrator holds 43 files during a run, a node 26.
_FILES_HELD, _FILES_NEEDED, _FILES_EASY = 43, 64, 256
# Kernel's default. Nothing is lost with it; with the 4 MB that the graph asks for a reader may be
# late for longer before something has to be sent again.
_RECEIVE_BUFFER = 212_992


class ClockPair(NamedTuple):
    """One reading of both clocks: monotonic and wall time, and the time it took [s]."""

    monotonic: float
    wall: float
    width: float


def read_clocks(monotonic: Callable[[], float], wall: Callable[[], float]) -> ClockPair:
    """Read the wall clock between two readings of the monotonic one."""
    before, now, after = monotonic(), wall(), monotonic()
    return ClockPair(0.5 * (before + after), now, after - before)


def judge_resolution(resolution: float) -> Finding:
    """Return whether the monotonic clock's resolution [s] serves a machine of 1 kHz."""
    return judged(
        "clock resolution",
        f"{1e9 * resolution:.0f} ns",
        "choose another clock source, such as tsc or hpet",
        fine=resolution <= _FINE,
        fails=resolution > _COARSE,
    )


def judge_date(wall: float, newest: float) -> Finding:
    """Return whether the time of day [s] is later than the newest installed file [s]."""
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
    first, *others = pairs
    # A difference that the readings' own widths explain is no jump.
    drifts = [
        abs((pair.wall - first.wall) - (pair.monotonic - first.monotonic))
        - 0.5 * (pair.width + first.width)
        for pair in others
    ]
    drift = max(*drifts, 0.0)
    found = (
        f"{drift / MILLISECOND:.3f} ms apart over {others[-1].monotonic - first.monotonic:.2f} s"
    )
    advice = (
        "something sets the clock; let it slew (chronyd), or latencies in /diagnostics are wrong"
    )
    return judged("clock jumps", found, advice, fine=drift <= _JUMP)


def judge_synchronisation(answer: str | None) -> Finding:
    """Return whether the clock follows a time server.

    Args:
        answer: `yes` or `no` of timedatectl; None when it cannot tell.
    """
    if answer is None:
        return ok("time server", "timedatectl cannot tell; one machine needs none")
    if answer == "yes":
        return ok("time server", "the clock is synchronised")
    return warn(
        "time server",
        "the clock is not synchronised",
        "timedatectl set-ntp true, if records of several machines are to be compared",
    )


def judge_disk(folder: Path, monotonic: Callable[[], float], size: int = _TRIAL) -> list[Finding]:
    """Return space and speed of a folder's disk for recordings.

    Args:
        folder: Where recordings would go.
        monotonic: Clock [s].
        size: Of the file that is written to time the disk [bytes].
    """
    try:
        state = os.statvfs(folder)
        space = judge_space(folder, state.f_bavail * state.f_frsize)
        with tempfile.TemporaryFile(dir=folder, prefix=".winding-doctor-") as file:
            content, before = os.urandom(size), monotonic()
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
            speed = size / max(monotonic() - before, 1.0e-6)
    except OSError as error:
        refusal = f"{folder}: {error.strerror or error}"
        advice = "work in a folder that you may write into"
        return [fail(check, refusal, advice) for check in ("disk space", "disk speed")]
    return [space, judge_speed(speed)]


def judge_space(folder: Path, free: int) -> Finding:
    """Return how long a recording the free space [bytes] of a folder's disk takes."""
    seconds = free / RECORDED_PER_SECOND
    length = f"{seconds:.0f} s" if seconds < 600.0 else f"{seconds / 60.0:.0f} min"
    short, hour = (RECORDED_PER_SECOND * t / _GIGABYTE for t in (_SHORT, _LONG))
    found = (
        f"{free / _GIGABYTE:.2f} GB free in {folder}, {length} of recording "
        f"({_SHORT:.0f} s take {short:.2f} GB, an hour {hour:.0f} GB)"
    )
    if seconds < _SHORT:
        return fail("disk space", found, "make room, or record elsewhere with --bag")
    if seconds < _LONG:
        return warn("disk space", found, "record long runs elsewhere, or with --compression zstd")
    return ok("disk space", found)


def judge_speed(bytes_per_second: float) -> Finding:
    """Return whether the disk keeps up with a recording in real time."""
    found = (
        f"{bytes_per_second / _MEGABYTE:.0f} MB/s written and synced; a recording in real time "
        f"brings {RECORDED_PER_SECOND / _MEGABYTE:.0f} MB/s"
    )
    advice = "record onto a faster disk; what waits is kept in memory meanwhile"
    return judged("disk speed", found, advice, fine=bytes_per_second >= RECORDED_PER_SECOND)


def judge_processors(count: int, load: float) -> Finding:
    """Return whether there is time for the graph.

    Args:
        count: Processors that this process may use.
        load: Count of processes that wanted one, on average over the last minute.
    """
    found = f"{count} with {load:.1f} processes wanting them"
    if count < _PROCESSORS:
        return warn("processors", found, "runs are slower than real time; give the machine two")
    advice = "runs and their supervision are late until others end"
    return judged("processors", found, advice, fine=load <= count)


def judge_memory(available: float) -> Finding:
    """Return whether available memory [bytes] holds the graph and the buffer of a run."""
    found = f"{available / _GIGABYTE:.1f} GB available"
    advice = f"the graph takes {_MEMORY / _GIGABYTE:.0f} GB; end others"
    return judged("memory", found, advice, fine=available >= _MEMORY)


def judge_open_files(limit: int) -> Finding:
    """Return whether a process may open as many files as the graph's busiest does."""
    found = f"{limit} for each process; the orchestrator of a run holds {_FILES_HELD}"
    advice = "ulimit -n 1024, or LimitNOFILE=1024 in the unit"
    fine, fails = limit >= _FILES_EASY, limit < _FILES_NEEDED
    return judged("open files", found, advice, fine=fine, fails=fails)


def judge_receive_buffer(limit: int | None) -> Finding:
    """Return whether sockets may be given a receive buffer [bytes]; None when it is unknown."""
    check = "net.core.rmem_max"
    if limit is None:
        return ok(check, "cannot tell")
    advice = f"sysctl -w {check}={_RECEIVE_BUFFER}"
    return judged(check, f"{limit} bytes", advice, fine=limit >= _RECEIVE_BUFFER)
