"""Shared memory, through which frames go from the camera to the tracker."""

from __future__ import annotations

import contextlib
import os
import re
from dataclasses import dataclass
from pathlib import Path

from winding_bringup.doctor.finding import Finding, fail, ok, warn
from winding_bringup.doctor.locks import is_held

# One segment of 70 MB for frames, five of 4.4 MB for the other nodes, the orchestrator and the
# operator's page, and their ports: about 95 MB.
NEEDED = 110_000_000
_MEGABYTE = 1.0e6
_SEGMENT = re.compile(r"fastrtps_[0-9a-f]{16}")


@dataclass(frozen=True, kw_only=True)
class SharedMemory:
    """What a look at the folder of shared memory says.

    Attributes:
        free: Room in it [bytes]; None when there is no such folder.
        refusal: Why nothing can be written there; empty when it can.
        left: Files of dead processes with their sizes [bytes].
    """

    free: int | None
    refusal: str
    left: dict[str, int]


def look(folder: Path) -> SharedMemory:
    """Return what a folder of shared memory, such as /dev/shm, holds."""
    try:
        state = os.statvfs(folder)
    except OSError:
        return SharedMemory(free=None, refusal="", left={})
    return SharedMemory(
        free=state.f_bavail * state.f_frsize, refusal=_refusal(folder), left=_left(folder)
    )


def judge_shared_memory(folder: Path, found: SharedMemory) -> list[Finding]:
    """Return what becomes of frames, and what is left of dead processes."""
    if found.free is None:
        missing = f"there is no {folder}"
        return [
            fail("shared memory", missing, f"mount a tmpfs on {folder}"),
            ok("left-over shared memory", "nothing"),
        ]
    free, needed = (f"{size / _MEGABYTE:.0f} MB" for size in (found.free, NEEDED))
    if found.refusal:
        room = fail("shared memory", f"{folder}: {found.refusal}", f"chmod 1777 {folder}")
    elif found.free < NEEDED:
        room = warn(
            "shared memory",
            f"{free} free in {folder}; a run takes {needed}. Frames go over UDP then and may "
            "come late",
            f"mount -o remount,size=512m {folder}, or run the container with --shm-size=512m",
        )
    else:
        room = ok("shared memory", f"{free} free in {folder}; a run takes {needed}")
    if not found.left:
        return [room, ok("left-over shared memory", "nothing")]
    size = sum(found.left.values()) / _MEGABYTE
    return [
        room,
        warn(
            "left-over shared memory",
            f"{len(found.left)} files of dead processes, {size:.1f} MB",
            "`winding run` removes them before it starts; by hand: fastdds shm clean",
        ),
    ]


def _refusal(folder: Path) -> str:
    trial = folder / f"winding_doctor_{os.getpid()}"
    try:
        trial.write_bytes(b"\0")
    except OSError as error:
        return error.strerror or str(error)
    finally:
        with contextlib.suppress(OSError):
            trial.unlink()
    return ""


def _left(folder: Path) -> dict[str, int]:
    """Return the segments whose owner holds their lock no more."""
    left = {}
    for segment in folder.iterdir():
        if not _SEGMENT.fullmatch(segment.name):
            continue
        # What ends in between was not left over.
        with contextlib.suppress(OSError):
            if not is_held(folder / f"{segment.name}_el"):
                left[segment.name] = segment.stat().st_size
    return left
