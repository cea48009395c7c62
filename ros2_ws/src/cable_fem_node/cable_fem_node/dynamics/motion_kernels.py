"""One central-difference step of free and driven nodes."""

from typing import NamedTuple

from cable_fem_node.dynamics.compile import called, kernel
from cable_fem_node.dynamics.contact_kernels import touch_cylinder
from cable_fem_node.dynamics.state import (
    LOSS_DAMPING,
    WORK_SPAN,
    WORK_TIE,
    ContactLaw,
    FloatArray,
    Points,
    Surface,
)


class BoundaryConditions(NamedTuple):
    """Loads, constraints and damping of a model's nodes."""

    mass: FloatArray  # (nodes,)
    free: FloatArray  # (3, nodes)
    driven: FloatArray  # (3, nodes) [m/s]
    load: FloatArray  # (3, nodes) [N]
    gravity: FloatArray  # (3,)
    load_times: FloatArray
    load_values: FloatArray
    damping_rate: float
    calming: bool  # kinetic damping: stand still whenever the kinetic energy has passed a peak
    reach: float  # radius at which nodes touch the cylinder; negative without one


@called
def amplitude_at(t: float, times: FloatArray, values: FloatArray) -> float:
    """Return the piecewise linear amplitude of the loads; constant beyond its ends."""
    last = times.shape[0] - 1
    if t <= times[0]:
        value: float = values[0]
        return value
    for i in range(last):
        if t < times[i + 1]:
            share = (t - times[i]) / (times[i + 1] - times[i])
            value = values[i] + share * (values[i + 1] - values[i])
            return value
    value = values[last]
    return value


@kernel
def move(
    dt: float,
    kick: float,
    points: Points,
    net: FloatArray,
    couple: FloatArray,
    around: BoundaryConditions,
    load_factor: float,
    touch: ContactLaw,
    ledger: FloatArray,
) -> float:
    """Add the cylinder's push and move every node by one step.

    Args:
        dt: Step [s].
        kick: Share of a step: 1, or 1/2 from rest, as velocities live at half steps.
        points: State, changed.
        net: Internal forces (3, nodes) [N]; contact is added.
        couple: Friction's torque about the cable's axis (nodes,) [N m], set.
        around: Loads, constraints, damping.
        load_factor: Amplitude of the loads.
        touch: Constants of the contact.
        ledger: Energies [J], added to.

    Returns:
        the kinetic energy [J] at the middle of the step.
    """
    mass = around.mass
    nodes = mass.shape[0]
    if around.reach > 0.0:
        surface = Surface(
            turned=0.0, turning=0.0, landing=around.reach, rolling=False, edge=nodes, gripped=nodes
        )
        touch_cylinder(0, nodes, dt, surface, points, mass, net, couple, touch, ledger)
    position, velocity = points.position, points.velocity
    load, free, driven = around.load, around.free, around.driven
    half = 0.5 * around.damping_rate * dt
    loads = 0.0
    ties = 0.0
    damping = 0.0
    kinetic = 0.0
    for c in range(3):
        pull = around.gravity[c]
        for i in range(nodes):
            before = velocity[c, i]
            given = load_factor * load[c, i] + mass[i] * pull
            force = net[c, i] + given
            moved = (before * (1.0 - half) + kick * dt * force / mass[i]) / (1.0 + half)
            held = 1.0 - free[c, i]
            after = free[c, i] * moved + held * driven[c, i]
            middle = 0.5 * (before + after)
            loads += given * middle
            ties -= held * force * middle
            damping += free[c, i] * mass[i] * middle * middle
            kinetic += free[c, i] * mass[i] * after * after
            velocity[c, i] = after
            position[c, i] += dt * after
    ledger[WORK_SPAN] += dt * loads
    ledger[WORK_TIE] += dt * ties
    ledger[LOSS_DAMPING] += dt * around.damping_rate * damping
    return 0.5 * kinetic
