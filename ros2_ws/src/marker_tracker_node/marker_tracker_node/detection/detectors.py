"""Which detector measures a kind of marker: the only place that knows them by name.

A detector is a module of this package with a compiled function `measure`, which has the arguments
of `colour_band.measure` and returns a `Detection`. One that reads which marker it sees returns its
number as identity, which then counts as evidence when markers are numbered.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from marker_tracker_node.camera.pinhole import CameraView
from marker_tracker_node.detection import colour_band
from marker_tracker_node.detection.band import Band, Body
from marker_tracker_node.detection.gate import Detection, Gates, Picture
from winding_core.compiling import called
from winding_core.markers import BAND, DOT

# Modules of detectors by `marker_kind`; named as modules, so that a change in one compiles anew
# the kernels that reach it, see `compiling`.
DETECTORS = {
    BAND: colour_band,
    DOT: colour_band,
}
_MODULES = tuple(dict.fromkeys(DETECTORS.values()))


def detector_number(kind: str) -> int:
    """Return the number by which kernels choose the detector of a kind of marker.

    Raises:
        ValueError: No detector measures such markers.
    """
    if kind not in DETECTORS:
        raise ValueError(f"marker_kind must be one of {', '.join(DETECTORS)}, got {kind!r}")
    return _MODULES.index(DETECTORS[kind])


def _chosen(number: int) -> Any:
    """Return a function that calls the detector of a number or a later one; the last is sure."""
    measure: Callable[..., Detection] = _MODULES[number].measure
    if number == len(_MODULES) - 1:

        @called
        def last(
            detector: int,
            picture: Picture,
            view: CameraView,
            body: Body,
            gates: Gates,
            n: int,
            band: Band,
            pixels: float,
            area: float,
            limits: tuple[float, float],
        ) -> Detection:  # pragma: no cover
            return measure(picture, view, body, gates, n, band, pixels, area, limits)

        return last
    later = _chosen(number + 1)

    @called
    def this_or_later(
        detector: int,
        picture: Picture,
        view: CameraView,
        body: Body,
        gates: Gates,
        n: int,
        band: Band,
        pixels: float,
        area: float,
        limits: tuple[float, float],
    ) -> Detection:  # pragma: no cover
        if detector == number:
            return measure(picture, view, body, gates, n, band, pixels, area, limits)
        found: Detection = later(
            detector, picture, view, body, gates, n, band, pixels, area, limits
        )
        return found

    return this_or_later


# Measures a mark with the detector of a number; the other arguments are those of `measure`.
# While there is one detector it is called without a question.
measure_mark = _chosen(0)
