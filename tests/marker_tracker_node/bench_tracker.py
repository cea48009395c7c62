"""Speed of the tracker beside the classic pipeline, in CPU time of one core.

Run with: python tests/marker_tracker_node/bench_tracker.py
"""

from __future__ import annotations

import copy
import sys
import time
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from cable_winding.cases import paper_case
from conftest import DRIVE, FREE_LENGTH, Film
from winding_rig_node.camera import CameraConfig
from winding_rig_node.lay import published_lay

UNSEEN = 48


def classic(frame: np.ndarray) -> int:
    """HSV, range, opening, connected components: the pipeline of the public colour trackers."""
    hsv = cv2.cvtColor(frame, cv2.COLOR_BGR2HSV)
    mask = cv2.inRange(hsv, (18, 110, 50), (35, 255, 255))
    mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    count, _, stats, _ = cv2.connectedComponentsWithStats(mask)
    return int((stats[1:count, cv2.CC_STAT_AREA] > 20).sum())


def spent(action, repeats: int) -> list[float]:
    """CPU seconds of each repetition."""
    out = []
    for k in range(repeats):
        start = time.thread_time()
        action(k)
        out.append(time.thread_time() - start)
    return out


def measure(name: str, camera: CameraConfig, count: int) -> None:
    """Print batch, single-frame and classic times on frames that show every marker."""
    case = paper_case(4)
    lay = published_lay(case, DRIVE, FREE_LENGTH, DRIVE.positions(20.0)[0])
    film = Film(case=case, lay=lay, camera=camera)
    tracker = film.tracker()
    for t, frame, angle, guide in film.frames(30.0, stop=14.9):
        tracker.track(frame, t, angle, guide)
    rows = list(film.frames(1000.0, start=14.91, stop=14.91 + count / 1000.0))
    times, frames, angles, guides = (np.array(part) for part in zip(*rows, strict=True))
    copies = [copy.deepcopy(tracker) for _ in range(8)]
    batch = spent(lambda k: copies[k].process(frames, times, angles, guides), 8)
    records = copy.deepcopy(tracker).process(frames, times, angles, guides)
    seen = ((records["flags"] & UNSEEN) == 0).sum(axis=1).mean()
    alone = copy.deepcopy(tracker)
    # Each frame is visited once: at full size none of it is in the cache.
    single = spent(lambda k: alone.track(frames[k], times[k], angles[k], guides[k]), len(frames))
    old = spent(lambda k: classic(frames[k]), len(frames))
    for what, cost in (
        ("batch, per frame", np.median(batch) / len(frames)),
        ("single frame", np.median(single)),
        ("HSV + connectedComponents", np.median(old)),
    ):
        print(f"{name:10s} {what:26s} {1e6 * cost:9.1f} us {1.0 / cost:9.0f} frames/s")
    print(f"{name:10s} markers measured a frame: {seen:.2f}")


if __name__ == "__main__":
    cv2.setNumThreads(1)
    measure("640x96", CameraConfig(), 300)
    measure("1920x1080", CameraConfig().full_frame(), 60)
