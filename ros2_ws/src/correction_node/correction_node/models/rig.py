"""Physics of the rig: the span tension behind the weight, and the lengths that it explains."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from correction_node.models.dataset import Array, LengthCell, MarkerCondition, lengths
from winding_core.cable.cases import Case
from winding_core.cable.material_law import LAWS
from winding_core.lay.quasi_static import QuasiStaticLay
from winding_core.machine.tension import START, DeadWeight, RigTension, fit_rig_tension

RIG_LAW = "neo_hookean"


def case_of(markers: Sequence[MarkerCondition]) -> Case:
    """Return the case that markers of one cable belong to."""
    last = max(markers, key=lambda condition: condition.marker)
    return Case(
        number=last.case,
        cylinder_diameter=last.cylinder_diameter,
        cable_diameter=last.cable_diameter,
        weight=0.25 * math.pi * last.cable_diameter**2 * last.tension,
        marker_spacing=last.original_length / last.marker,
        marker_count=last.marker,
    )


class LayOns:
    """The quasi-static lay-on of every cable among some markers.

    Args:
        conditions: Markers; those with the same case number are on one cable.
        law: Material law.
    """

    def __init__(self, conditions: Sequence[MarkerCondition], law: str) -> None:
        cables: dict[int, list[MarkerCondition]] = {}
        for condition in conditions:
            cables.setdefault(condition.case, []).append(condition)
        self._cables: Mapping[int, QuasiStaticLay] = {
            case: QuasiStaticLay(case_of(markers), law) for case, markers in cables.items()
        }

    def lengths(
        self, conditions: Sequence[MarkerCondition], tension: DeadWeight | RigTension
    ) -> Array:
        """Return S_n [m] of markers on these cables under a span tension, shape (n,)."""
        asked = {condition.case for condition in conditions}
        laid = {case: self._cables[case].curve_lengths(tension) for case in asked}
        return np.array([laid[c.case][c.marker - 1] for c in conditions])


def fit_rig(cells: Sequence[LengthCell], lay_ons: LayOns, start: RigTension = START) -> RigTension:
    """Return the span-tension law with the smallest sum of squared relative length errors.

    Args:
        cells: Measured cells; at least six.
        lay_ons: Of these cells' cables.
        start: Where the search begins.
    """
    _, measured = lengths(cells)
    return fit_rig_tension(lambda law: lay_ons.lengths(cells, law) / measured - 1.0, start).tension


def reference_law(cells: Sequence[MarkerCondition]) -> tuple[str, float]:
    """Return the material law whose dead-weight lay-on is closest to predicted lengths.

    Returns:
        The law and its largest relative difference from S_FEM.
    """
    s_fem = np.array([cell.s_fem for cell in cells])
    distance = {
        law: float(np.abs(LayOns(cells, law).lengths(cells, DeadWeight()) / s_fem - 1.0).max())
        for law in LAWS
    }
    nearest = min(distance, key=lambda law: distance[law])
    return nearest, distance[nearest]
