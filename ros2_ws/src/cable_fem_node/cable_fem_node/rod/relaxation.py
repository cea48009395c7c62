"""Viscous stress of a rod's elements: its recursion over a step, its energy, its heat.

The elements' part of `winding_core.cable.prony`. A branch that carries q of its full g P0 is a
spring with the law of g P0, stretched to where that carries q, in series with a dashpot that has
taken the rest. With e the strain and e_i that of a branch's spring, the energy per reference length
is W(e) + sum_i [q_i (e_i - e) - g_i W(e_i)], and (e - e_i) dq_i turns to heat.
"""

import math

from cable_fem_node.dynamics.compile import called, kernel
from cable_fem_node.dynamics.state import FloatArray, Points
from cable_fem_node.rod.rod_kernels import law_energy
from cable_fem_node.rod.rod_records import AxialResponse, Constants, Relaxation, Work


@called
def strain_under(force: float, relax: Relaxation) -> float:
    """Return the strain at which the law carries a force [N] at once, within the table."""
    last = relax.strain.shape[0] - 1
    place = min(max(0.0, (force - relax.low) * relax.per_spacing), last - 1.0e-9)
    i = int(place)
    u = place - i
    value: float = relax.strain[i] + u * (relax.strain[i + 1] - relax.strain[i])
    return value


@called
def decays(dt: float, relax: Relaxation, decay: FloatArray, ramp: FloatArray) -> None:
    """Fill what is left of a branch after a step of dt [s], and what a linear rise adds to it."""
    for j in range(relax.share.shape[0]):
        a = dt / relax.time[j]
        decay[j] = math.exp(-a)
        ramp[j] = -math.expm1(-a) / a


@called
def fade(
    elastic: float,
    strain: float,
    viscous: FloatArray,
    i: int,
    decay: FloatArray,
    ramp: FloatArray,
    relax: Relaxation,
) -> tuple[float, float, float]:
    """Take the branches of one element over a step in which its elastic force runs linearly.

    The recursion is exact for that, however long the step is.

    Args:
        elastic: What the law carries at once at the end of the step [N].
        strain: There, dimensionless.
        viscous: Elastic force at the begin of the step, then every branch's q [N], one row each,
            changed; shape (1 + terms, elements).
        i: The element.
        decay: As of `decays`, shape (terms,).
        ramp: As of `decays`, shape (terms,).
        relax: Of the cable.

    Returns:
        q of all branches at the end, its change [N], and the heat per reference length [J/m].
    """
    taken, change, heat = 0.0, 0.0, 0.0
    start = viscous[0, i]
    for j in range(relax.share.shape[0]):
        before = viscous[1 + j, i]
        g = relax.share[j]
        after = decay[j] * before + g * ((1.0 - ramp[j]) * elastic + (ramp[j] - decay[j]) * start)
        viscous[1 + j, i] = after
        taken += after
        change += after - before
        heat += (strain - strain_under(0.5 * (before + after) / g, relax)) * (after - before)
    viscous[0, i] = elastic
    return taken, change, heat


@called
def branch_energy(
    strain: float, column: FloatArray, response: AxialResponse, relax: Relaxation
) -> float:
    """Return what the branches of one element take off its elastic energy, per length [J/m]."""
    energy = 0.0
    for j in range(relax.share.shape[0]):
        g, q = relax.share[j], column[1 + j]
        own = strain_under(q / g, relax)
        energy += q * (own - strain) - g * response.area * law_energy(1.0 + own, response)
    return energy


@kernel
def branches_energy(
    stretch: FloatArray,
    reference: FloatArray,
    viscous: FloatArray,
    response: AxialResponse,
    relax: Relaxation,
) -> float:
    """Return what the branches of elements take off their elastic energy [J].

    Args:
        stretch: Of the elements, shape (n,).
        reference: Their lengths [m], shape (at least n,).
        viscous: Columns as in `fade`, shape (1 + terms, at least n).
        response: Axial response of the cable.
        relax: Of the cable.
    """
    total = 0.0
    for i in range(stretch.shape[0]):
        total += reference[i] * branch_energy(stretch[i] - 1.0, viscous[:, i], response, relax)
    return total


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
            # Cable that lies on cable does not press on the cylinder.
            pressed = 1.0 if depth > 0.0 else 0.0
            less = pressed * 0.5 * (change_before + change) * length / (k.contact_line * stiffness)
            cable.contact_radius[i] -= less
            heat += 0.5 * stiffness * (2.0 * depth - less) * less
        change_before = change
    return heat
