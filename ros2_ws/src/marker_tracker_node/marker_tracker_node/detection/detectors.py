"""Which detector measures a kind of marker: the only place that knows them by name.

A detector is a module of this package with a compiled function `measure`, which has the arguments
of `colour_band.measure` and returns a `Detection`. One that reads which marker it sees returns its
number as identity, which then counts as evidence when markers are numbered.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from marker_tracker_node.detection import colour_band
from marker_tracker_node.detection.gate import Detection
from winding_core.compiling import called
from winding_core.markers import BAND, DOT

# Modules of detectors by `marker_kind`; named as modules, so that a change in one compiles anew
# the kernels that reach it, see `compiling`.
DETECTORS = {BAND: colour_band, DOT: colour_band}
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
        def last(detector: int, *mark: Any) -> Detection:  # pragma: no cover
            return measure(*mark)

        return last
    later: Callable[..., Detection] = _chosen(number + 1)

    @called
    def this_or_later(detector: int, *mark: Any) -> Detection:  # pragma: no cover
        return measure(*mark) if detector == number else later(detector, *mark)

    return this_or_later


# Measures a mark with the detector of a number; the other arguments are those of `measure`.
# While there is one detector it is called without a question.
measure_mark = _chosen(0)
