"""Which predicted lengths no cable can have."""

from __future__ import annotations

import numpy as np

from winding_core.cable.cases import Case
from winding_core.cable.material_law import TABLE_HIGH
from winding_core.markers import Markers

# S counts the path at R + r. Cable that is pulled is at least as long as it was; the wound radius
# of a stretched one is smaller by less than this, and the solver's noise is far below.
SLACK = 0.05


def implausible(wound: Markers, condition: Case) -> dict[int, str]:
    """Return one sentence for each record that cannot be right, by its index.

    A length must be finite, no shorter than the undeformed cable before the marker (5 % are
    given for thinning) and no longer than the material tables reach; markers must be numbered
    as the cable's are, once each, and lie one after the other along it.

    Args:
        wound: MARKER_DTYPE records of markers on the cylinder, shape (n,), in any order.
        condition: What is being wound.
    """
    found: dict[int, str] = {}
    last, last_marker = -np.inf, -1
    for index in np.argsort(wound["id"], kind="stable").tolist():
        marker, length = int(wound["id"][index]), float(wound["s"][index])
        sentence = _alone(marker, length, condition)
        if sentence is None and marker == last_marker:
            sentence = f"marker {marker} stands twice"
        if sentence is None and not length > last:
            sentence = (
                f"marker {marker} lies before marker {last_marker}: {length:.4g} m against "
                f"{last:.4g} m"
            )
        if sentence is None:
            last, last_marker = length, marker
        else:
            found[index] = sentence
    return found


def _alone(marker: int, length: float, condition: Case) -> str | None:
    if marker > condition.marker_count:
        return f"marker {marker} does not exist: this cable has {condition.marker_count}"
    if not np.isfinite(length) or length < 0.0:
        return f"marker {marker} has no usable length, got {length} m"
    original = condition.original_length(marker)
    if length < (1.0 - SLACK) * original:
        return (
            f"marker {marker} is shorter than physics allows: {length:.4g} m of cable that "
            f"measures {original:.4g} m unstretched"
        )
    if marker > 0 and length > TABLE_HIGH * original:
        return (
            f"marker {marker} is longer than the material's tables reach: {length:.4g} m of "
            f"cable that measures {original:.4g} m unstretched"
        )
    return None
