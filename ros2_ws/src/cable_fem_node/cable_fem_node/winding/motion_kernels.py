"""How the winding rod's nodes move in one step: in space, and about the cable's own axis."""

from __future__ import annotations

import math

from cable_fem_node.dynamics.compile import called
from cable_fem_node.dynamics.points import FloatArray, Points
from cable_fem_node.rod.rod_arrays import Work
from cable_fem_node.winding.winding_state import Constants


@called
def move_nodes(
    elements: int,
    dt: float,
    rate: float,
    guide_speed: float,
    cable: Points,
    tangent: FloatArray,
    net: FloatArray,
    k: Constants,
) -> float:
    """Take one central-difference step of the inner nodes; return the damping loss [J].

    Mass-proportional damping acts on the velocity relative to the motion that is meant: with
    the surface where the cable lies on it, along the cable's own line with the feed where it
    does not. Damping towards the lab frame would add false tension, and damping towards the
    straight span would press a stiff cable, which lands on a curve, against the cylinder.
    """
    x, v = cable.position, cable.velocity
    half = 0.5 * k.damping_rate * dt
    decay = (1.0 - half) / (1.0 + half)
    push = dt / (k.mass * (1.0 + half))
    feed = -0.5 * k.contact_line * rate
    follow = -guide_speed / k.free_length
    loss = 0.0
    for i in range(1, elements):
        px, py = x[0, i], x[1, i]
        wound = cable.touching[i] == 1
        rx = -rate * py if wound else feed * (tangent[0, i - 1] + tangent[0, i])
        ry = rate * px if wound else feed * (tangent[1, i - 1] + tangent[1, i])
        rz = 0.0 if wound else follow * py
        wx, wy, wz = v[0, i] - rx, v[1, i] - ry, v[2, i] - rz
        ux = wx * decay + push * net[0, i]
        uy = wy * decay + push * net[1, i]
        uz = wz * decay + push * net[2, i]
        mx, my, mz = 0.5 * (ux + wx), 0.5 * (uy + wy), 0.5 * (uz + wz)
        loss += mx * (mx + rx) + my * (my + ry) + mz * (mz + rz)
        v[0, i] = ux + rx
        v[1, i] = uy + ry
        v[2, i] = uz + rz
        x[0, i] = px + dt * v[0, i]
        x[1, i] = py + dt * v[1, i]
        x[2, i] += dt * v[2, i]
    return k.mass * k.damping_rate * dt * loss


@called
def roll_nodes(elements: int, dt: float, cable: Points, work: Work, k: Constants) -> None:
    """Take one step of the cable's rotation about its own axis.

    The roll angle counts from the surface normal, so a wound helix twists by its geodesic
    torsion even where the cable does not roll. Node 0 is held, the guide lets the cable spin.
    """
    roll, touching, tangent = cable.roll, cable.touching, work.tangent
    decay = 1.0 - k.damping_rate * dt
    before = 0.0
    for i in range(elements):
        after = 0.0
        if i < elements - 1:
            twist = (roll[0, i + 1] - roll[0, i]) / k.segment
            if touching[i] == 1 and touching[i + 1] == 1:
                level = math.sqrt(tangent[0, i] ** 2 + tangent[1, i] ** 2)
                twist -= tangent[2, i] * level / k.contact_line
            after = k.torsion * twist
        if i > 0:
            torque = work.couple[i] + after - before
            roll[1, i] = decay * roll[1, i] + dt * torque / k.roll_inertia
        before = after
    for i in range(1, elements):
        roll[0, i] += dt * roll[1, i]
