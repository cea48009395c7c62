"""The disk that recordings go to."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path

from winding_cli.doctor.finding import Finding, fail, ok, warn

# Measured: 188.2 MB in 5 s and 11.15 GB in 300 s of simulated time, frames of 640 x 96.
RECORDED_PER_SECOND = 38_000_000
_SHORT, _LONG = 20.0, 3600.0
_GIGABYTE, _MEGABYTE = 1.0e9, 1.0e6
_TRIAL = 8_000_000


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
    if bytes_per_second >= RECORDED_PER_SECOND:
        return ok("disk speed", found)
    return warn(
        "disk speed", found, "record onto a faster disk; what waits is kept in memory meanwhile"
    )


def judge_no_disk(refusal: str) -> list[Finding]:
    """Return both findings of a folder that takes no file."""
    advice = "work in a folder that you may write into"
    return [fail("disk space", refusal, advice), fail("disk speed", refusal, advice)]


def free_space(folder: Path) -> int:
    """Return what this user may still write into a folder [bytes]."""
    state = os.statvfs(folder)
    return state.f_bavail * state.f_frsize


def write_speed(folder: Path, monotonic: Callable[[], float], size: int = _TRIAL) -> float:
    """Return how fast a small file reaches a folder's disk [bytes/s].

    Raises:
        OSError: Nothing can be written there, or not as much.
    """
    content = os.urandom(size)
    with tempfile.TemporaryFile(dir=folder, prefix=".winding-doctor-") as file:
        before = monotonic()
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
        return size / max(monotonic() - before, 1.0e-6)
