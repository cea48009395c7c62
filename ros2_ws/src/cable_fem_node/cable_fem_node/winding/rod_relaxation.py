"""Relaxation of the integrated part of a wound rod: one step of its elements and their contact."""

from __future__ import annotations

import math

from cable_fem_node.dynamics.compile import called
from cable_fem_node.dynamics.points import FloatArray, Points
from cable_fem_node.rod.relaxation import fade
from cable_fem_node.rod.rod_arrays import Relaxation, Work
from cable_fem_node.winding.winding_state import Constants


@called
def relax_elements(
    elements: int,
    cable: Points,
    reference: FloatArray,
    viscous: FloatArray,
    decay: FloatArray,
    ramp: FloatArray,
    relax: Relaxation,
    k: Constants,
    work: Work,
) -> float:
    """Take the branches' forces off the elements' tensions; return the heat [J].

    The cylinder is rigid: only its penalty spring lets wound cable sink in. Where the tension fades
    the spring is shortened so that the cable stays where it is.

    Args:
        elements: In use; the last one slides through the guide and makes no heat.
        cable: Nodes; the radii of those in contact are changed.
        reference: Lengths of the elements [m].
        viscous: Columns as in `fade`, shape (1 + terms, capacity), changed.
        decay: As of `decays`, shape (terms,).
        ramp: As of `decays`, shape (terms,).
        relax: Of the cable.
        k: Constants.
        work: Its tensions are the law's at once, and changed.
    """
    x = cable.position
    stiffness = k.touch.normal_stiffness
    heat, change_before = 0.0, 0.0
    for i in range(elements):
        length = 1.0 / work.inverse[i]
        strain = length / reference[i] - 1.0
        taken, change, lost = fade(work.tension[i], strain, viscous, i, decay, ramp, relax)
        work.tension[i] -= taken
        if i < elements - 1:
            heat += reference[i] * lost
        if i > 0 and cable.touching[i] == 1:
            radius = math.sqrt(x[0, i] * x[0, i] + x[1, i] * x[1, i])
            depth = cable.contact_radius[i] - radius
            less = 0.5 * (change_before + change) * length / (k.contact_line * stiffness)
            cable.contact_radius[i] -= less
            heat += 0.5 * stiffness * (2.0 * depth - less) * less
        change_before = change
    return heat
