"""The films that the tracker's own tests are made of, and the one that speed is measured on."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "marker_tracker_node"))
from marker_film import DRIVE, FREE_LENGTH, Film

from marker_tracker_node import Tracker
from winding_core.cable.cases import paper_case
from winding_rig_node.camera import CameraConfig
from winding_rig_node.lay.known_lay import published_lay


def live_scene(camera: CameraConfig, until: float) -> tuple[Any, Tracker]:
    """Return the film of case 4 under a camera, and a tracker that has followed it so long [s]."""
    case = paper_case(4)
    lay = published_lay(case, DRIVE, FREE_LENGTH, DRIVE.positions(20.0)[0])
    shown = Film(case=case, lay=lay, camera=camera)
    tracker = shown.tracker()
    for t, frame, angle, guide in shown.frames(30.0, stop=until):
        tracker.track(frame, t, angle, guide)
    return shown, tracker
