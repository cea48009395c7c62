"""Which detector measures a kind of marker: the only place that knows them by name.

A detector is a module of this package with a compiled function `measure`, which has the arguments
of `colour_band.measure` and returns a `Detection`. One that reads which marker it sees returns its
number as identity, which then counts as evidence when markers are numbered.
"""

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


@called
def measure_mark(detector: int, *mark: Any) -> Detection:  # pragma: no cover
    """Measure a mark with the detector of a number; the other arguments are those of `measure`."""
    # A second detector is asked for here by its number.
    return colour_band.measure(*mark)
