"""The lay beside the markers: what the tracker's frames and angles say of every turn."""

import csv
import math
from pathlib import Path

from marker_tracker_node.camera.pinhole import CameraPose
from marker_tracker_node.lay.config import KNOWN, LayConfig
from marker_tracker_node.lay.lay_tracker import LayReading, LayTracker
from marker_tracker_node.lay.report import LayReport
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.refinement import PoseBelief
from marker_tracker_node.tracking.synchronised_tracker import PairedFrame
from marker_tracker_node.tracking.tracker import Tracker
from winding_core.lay.records import LayFlag, name_of
from winding_core.units import MILLIMETRE

COLUMNS = ("turn", "theta_rad", "z_mm", "sigma_z_mm", "pitch_mm", "lift_mm", "flags")


class LayFollower:
    """A `LayTracker` that takes its angles from a marker tracker, and begins anew with it."""

    def __init__(self, belief: PoseBelief | None = None) -> None:
        """Start before a run.

        Args:
            belief: How well the camera's nominal pose is known; by ruler and level unless stated.
        """
        self._belief = PoseBelief() if belief is None else belief
        # Of this run; None before the first frame with an encoder reading.
        self.lay: LayTracker | None = None
        self._begun: tuple[Tracker, int, CameraPose] | None = None

    def take(self, pair: PairedFrame, tracker: Tracker) -> None:
        """Take a frame that a tracker has just measured."""
        if pair.cylinder_angle is None or pair.frame.shape[:2] != tracker.camera.shape:
            return
        begun = (tracker, tracker.beginnings, tracker.begun)
        if self.lay is None or begun != self._begun:
            self.lay = LayTracker(
                lay_config(tracker.config, tracker.begun, self._belief), tracker.camera
            )
            self._begun = begun
        self.lay.anchored = tracker.zeroed
        guide = pair.guide_z if pair.guide_z is not None else math.nan
        self.lay.take(pair.frame, LayReading(cylinder_angle=tracker.state.turned, guide_z=guide))


def lay_config(config: TrackerConfig, pose: CameraPose, belief: PoseBelief = KNOWN) -> LayConfig:
    """Return how the lay of a tracker's machine is measured from a pose of the camera."""
    return LayConfig(
        cylinder_radius=config.cylinder_radius,
        cable_radius=config.cable_radius,
        advance_per_radian=config.advance_per_radian,
        free_length=config.free_length,
        pose=pose,
        belief=belief,
    )


def write_lay(path: Path, report: LayReport) -> None:
    """Write a line for every place of the lay that was seen, with the columns COLUMNS."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for place in report.records:
            lengths = [place[name] / MILLIMETRE for name in ("z", "sigma_z", "pitch", "lift")]
            writer.writerow(
                [
                    int(place["turn"]),
                    f"{place['theta']:.6f}",
                    *(f"{length:.4f}" for length in lengths),
                    "+".join(name_of(flag) for flag in LayFlag if place["flags"] & flag),
                ]
            )
