"""What a model of h looks at: numbers of a condition, as the paper chose them or dimensionless."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from correction_node.models.dataset import Array, MarkerCondition
from winding_core.cable.cases import Case, Material
from winding_core.lay.quasi_static import QuasiStaticLay
from winding_core.machine.tension import DeadWeight

Inputs = Callable[[Sequence[MarkerCondition]], Array]


def condition_inputs(conditions: Sequence[MarkerCondition]) -> Array:
    """Return (D_cylinder [m], D_cable [m], ln of the tension in Pa), shape (n, 3).

    The paper's three inputs; the same for all markers of a case. Its tensions span a factor of
    18 and double from case to case, so their logarithm is what is evenly spaced.
    """
    return np.array(
        [(c.cylinder_diameter, c.cable_diameter, math.log(c.tension)) for c in conditions]
    )


def dimensionless_inputs(conditions: Sequence[MarkerCondition]) -> Array:
    """Return (ln sigma / E, ln D_cylinder / D_cable, n spacing / (pi D_cylinder)), shape (n, 3).

    How far the weight strains the cable, how sharply the cylinder bends it, and how many turns
    of unstretched cable lie before the marker.
    """
    young = Material().young
    return np.array(
        [
            (
                math.log(c.tension / young),
                math.log(c.cylinder_diameter / c.cable_diameter),
                turns(c),
            )
            for c in conditions
        ]
    )


def turns(condition: MarkerCondition) -> float:
    """Return how many turns of unstretched cable lie before a marker: n spacing / (pi D)."""
    return condition.original_length / (math.pi * condition.cylinder_diameter)


INPUTS: dict[str, Inputs] = {"condition": condition_inputs, "dimensionless": dimensionless_inputs}


def conditions_of(case: Case, law: str) -> tuple[MarkerCondition, ...]:
    """Return the conditions of a case's markers P1..Pn before anything is wound.

    Args:
        case: What is going to be wound.
        law: Material law of the solver whose lengths h multiplies. Its S_FEM is taken from the
            quasi-static lay-on under the dead weight, 0.14 % from the rod's at most.
    """
    reference = QuasiStaticLay(case, law).curve_lengths(DeadWeight())
    return tuple(
        MarkerCondition(
            case=case.number,
            marker=marker,
            cylinder_diameter=case.cylinder_diameter,
            cable_diameter=case.cable_diameter,
            tension=case.nominal_stress,
            original_length=case.original_length(marker),
            s_fem=float(s_fem),
        )
        for marker, s_fem in enumerate(reference, start=1)
    )
