"""The films that the tracker's own tests are made of, and the one that speed is measured on."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from marker_tracker_node import Tracker
from winding_core.cable.cases import paper_case
from winding_rig_node.camera import CameraConfig
from winding_rig_node.lay.known_lay import published_lay


def films() -> ModuleType:
    """Return the module that draws them."""
    path = Path(__file__).parents[2] / "tests" / "marker_tracker_node" / "conftest.py"
    spec = importlib.util.spec_from_file_location("tracker_films", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Dataclasses look their module up while they are made.
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def live_scene(camera: CameraConfig, until: float) -> tuple[Any, Tracker]:
    """Return the film of case 4 under a camera, and a tracker that has followed it so long [s]."""
    film, case = films(), paper_case(4)
    lay = published_lay(case, film.DRIVE, film.FREE_LENGTH, film.DRIVE.positions(20.0)[0])
    shown = film.Film(case=case, lay=lay, camera=camera)
    tracker = shown.tracker()
    for t, frame, angle, guide in shown.frames(30.0, stop=until):
        tracker.track(frame, t, angle, guide)
    return shown, tracker
