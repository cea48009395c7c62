"""Where the camera stands, or looks, if P0 passes beside the place that its pose gives."""

from __future__ import annotations

import math

import numpy as np

from marker_tracker_node.arrays import ByteArray
from marker_tracker_node.detection.colour import ColourModel
from marker_tracker_node.tracking.config import TrackerConfig
from marker_tracker_node.tracking.frame.acquisition import PROOF_ADVANCE
from marker_tracker_node.tracking.frame.laid_path import BAND_REACH, LAY_SIGMA
from marker_tracker_node.tracking.p0_search import SEARCH_REACH, WHOLE_ENOUGH, BandSearch
from marker_tracker_node.tracking.state import Setup
from winding_core.units import MILLIMETRE, MILLIRADIAN

# Errors of the camera's place along the axis, and of its height, that are tried [m]: so far apart
# that P0 lies within the reach of a search with one of them.
STEP, STEPS = 1.6 * SEARCH_REACH, 2
ERRORS = tuple(STEP * step for step in range(-STEPS, STEPS + 1) if step)


class MisplacedCamera:
    """Looks for P0 as it would pass if the camera stood elsewhere than is configured.

    Attributes:
        done: Whether P0 has passed often enough.
    """

    def __init__(self, config: TrackerConfig) -> None:
        """Start with nothing seen."""
        # The first marker lies lowest where the feed leads upwards.
        self.done = config.advance_per_radian <= 0.0
        self._gap = config.expected_gap
        # P0 has passed once after so much of the way; what is found earlier may be another marker.
        self._lap = math.tau + config.usable_azimuth
        self._searches = {
            (axis, error): BandSearch(config) for axis in ("z", "y") for error in ERRORS
        }
        # Error of the camera's place [m] with which P0 was found.
        self._found: dict[tuple[str, float], float] = {}
        self._begun = self._looked = self._guide = self._since = math.nan

    def add(
        self,
        frame: ByteArray,
        setup: Setup,
        angle: float,
        guide: float,
        *,
        followed: float,
        colour: ColourModel | None,
    ) -> str:
        """Take a frame; return where the camera may stand, empty while that is not known.

        The encoder reads `angle` [rad], the guide stands at `guide` [m], nan where that is missing.
        What is followed as P0 already, with an azimuth so far ahead of the reading [rad], may be a
        later marker; nan if nothing is. The markers' colour is None if it is not known.
        """
        # The live window shows bands of a thick cylinder for 0.46 rad: that is four looks and more.
        if abs(angle - self._looked) < 0.5 * PROOF_ADVANCE:
            return ""
        self._looked = angle
        if math.isnan(self._begun):
            self._begun, self._guide = angle, guide
        way, something = abs(angle - self._begun), math.isfinite(followed)
        if something and math.isnan(self._since):
            self._since = angle
        # A guide that goes back by more than cable lies off lays later markers below the first.
        self.done = way > 2.0 * self._lap or guide < self._guide - LAY_SIGMA
        # A marker before what is followed is in sight with it; a later one may be after half a
        # turn, and lies below it where the guide stands behind.
        self.done |= abs(angle - self._since) > math.pi
        if self.done:
            return ""
        view = setup.camera
        if something and not self._due(angle + followed, setup.usable_azimuth):
            return ""
        for (axis, error), search in self._searches.items():
            if something and (axis == "y" or error > 0.0):
                continue
            moved = view._replace(**{axis: getattr(view, axis) - error})
            band = search.add(frame, setup._replace(camera=moved), angle)
            if band is None or (something and self._strange(band.offset - followed)):
                continue
            # An encoder that is not zeroed would tell nothing of a height.
            beyond = band.z if axis == "z" else setup.body.rho * math.sin(band.offset)
            if abs(beyond) > STEP:
                continue
            # A cylinder may have the markers' hue.
            samples = np.concatenate(band.samples)
            if colour is None or colour.mask(samples[np.newaxis]).mean() > WHOLE_ENOUGH:
                self._found[axis, error] = error + beyond
        along = min((error for (axis, _), error in self._found.items() if axis == "z"), default=0.0)
        if something:
            return (
                beside_its_place(along, setup, "along the axis", "y")
                if along < -SEARCH_REACH
                else ""
            )
        if way < self._lap or not self._found:
            return ""
        if along:
            return beside_its_place(along, setup, "along the axis", "y")
        heights = [error for (axis, _), error in self._found.items() if axis == "y"]
        return beside_its_place(min(heights, key=abs), setup, "in height", "x")

    def _due(self, azimuth: float, usable: float) -> bool:
        """Return whether a marker before the one at an azimuth [rad] may be in sight."""
        before = [math.remainder(azimuth + n * self._gap, math.tau) for n in (1, 2)]
        return any(-BAND_REACH < place < usable for place in before)

    def _strange(self, ahead: float) -> bool:
        """Return whether a band so far ahead of a marker [rad] is none of those before it."""
        off = [math.remainder(ahead - n * self._gap, math.tau) for n in (1, 2)]
        return min(map(abs, off)) > BAND_REACH


def beside_its_place(error: float, setup: Setup, where: str, axis: str) -> str:
    """Say that the camera's place is wrong by an error [m], or its turn about an axis."""
    turned = abs(error) / abs(setup.camera.x)
    return (
        f"P0 passes {abs(error) / MILLIMETRE:.0f} mm beside its place: the camera's place {where} "
        f"is wrong by so much, or its turn about {axis} by {turned / MILLIRADIAN:.0f} mrad; set "
        "camera_tilt or camera_position"
    )
