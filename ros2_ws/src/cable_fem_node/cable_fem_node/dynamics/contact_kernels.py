"""Contact with a turning rigid cylinder about the z axis, and with the cable that is wound on it.

Penalty, Coulomb, stick with memory.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from cable_fem_node.dynamics.compile import called, kernel
from cable_fem_node.dynamics.state import (
    BELOW_ROWS,
    GONE,
    LOSS_CONTACT,
    LOSS_FRICTION,
    PUSHES,
    WORK_SURFACE,
    ContactLaw,
    FloatArray,
    Points,
    Surface,
)

# Share of its depth by which a landing node comes back in a step at most.
_RETURN = 0.25


def _touching(wound: bool) -> Callable[..., None]:
    """Return the contact of a bare cylinder, or of one with cable below its nodes.

    Compiled apart: what only cable below needs costs a fifth of the other.
    """

    def touch(
        begin: int,
        end: int,
        dt: float,
        surface: Surface,
        points: Points,
        mass: FloatArray,
        net: FloatArray,
        couple: FloatArray,
        k: ContactLaw,
        ledger: FloatArray,
    ) -> None:
        """Add the cylinder's push and friction to the net forces of nodes.

        Cable below pushes along the line between both centre lines, across its own, and is pushed
        back where it moves. Normal penalty with dashpot; a stick spring per node that remembers how
        far the node has moved over the turning surface and the cable below, cut back to Coulomb's
        limit (return mapping).

        A force acts in both steps that meet where it is taken, so that its work needs the
        velocities before and after; the latter follows from the net force, of which contact is the
        last part.

        Args:
            begin: First node that may touch.
            end: One past the last.
            dt: Step [s].
            surface: Of the cylinder.
            points: State; stick springs and contact flags are changed.
            mass: Of the nodes (nodes,) [kg].
            net: Net forces (3, nodes) [N], added to.
            couple: Friction's torque about the cable's axis (nodes,) [N m], set.
            k: Constants of the contact.
            ledger: Energies [J], added to.
        """
        x, v, slip, roll = points.position, points.velocity, points.slip, points.roll
        touching, contact_radius, below = points.touching, points.contact_radius, points.below
        work = 0.0
        if wound:
            work = _press(begin, end, dt, surface, points, net, k)
        stick = k.stick_stiffness
        per_stick = 1.0 / stick
        dashpot = k.stick_damping / dt
        turned, turning, edge = surface.turned, surface.turning, surface.edge
        lever = k.cable_radius if surface.rolling else 0.0
        sliding = 0.0
        bouncing = 0.0
        square_landing = surface.landing * surface.landing
        # The chord of what turned with the surface, along the tangent at its end, over the radius.
        # With the angle itself the springs of cable that lies still would creep.
        chord = math.sin(turned)
        for m in range(begin, end):
            # What lies on cable pushes it before that is held itself.
            i = begin + end - 1 - m if wound else m
            px, py = x[0, i], x[1, i]
            square = px * px + py * py
            held = touching[i] == 1
            lies = wound and below[PUSHES, i] > 0.0
            if not held:
                if square >= square_landing and not lies:
                    continue
                touching[i] = 1
                contact_radius[i] = surface.landing
            radius = math.sqrt(square)
            depth = contact_radius[i] - radius
            slip_t, slip_z = slip[0, i], slip[1, i]
            if depth <= 0.0 and not lies:
                # A node that lifts off leaves its spring's energy behind as heat.
                sliding += 0.5 * stick * (slip_t * slip_t + slip_z * slip_z)
                touching[i] = 0
                slip[0, i] = 0.0
                slip[1, i] = 0.0
                couple[i] = 0.0
                continue
            vx, vy = v[0, i], v[1, i]
            inverse = 1.0 / radius
            nx, ny = px * inverse, py * inverse
            # The velocity is half a step old: on a turning surface it points off the tangent here.
            # The dashpot acts on the rate of the radius itself, zero for a node that lies still.
            outward = vx * nx + vy * ny
            rising = outward - 0.5 * dt * (vx * vx + vy * vy) * inverse
            normal, damped = 0.0, 0.0
            if depth > 0.0 or not wound:
                elastic = k.normal_stiffness * depth
                normal = elastic - k.normal_damping * rising
                if i >= edge:
                    off = 2.0 * outward - rising + dt / mass[i] * (net[0, i] * nx + net[1, i] * ny)
                    normal = min(normal, mass[i] / dt * (_RETURN * depth / dt - off))
                normal = max(normal, 0.0)
                damped = normal - elastic
            if wound:
                # Friction acts across the push, along the circumference and in the axis' plane.
                up, along_z = normal + below[PUSHES + 2, i], below[PUSHES + 3, i]
                normal += below[PUSHES + 1, i]
                whole = math.sqrt(up * up + along_z * along_z)
                tr, tz = (-along_z / whole, up / whole) if along_z != 0.0 else (0.0, 1.0)
            moved, aside = 0.0, 0.0
            if held:
                if i < surface.gripped or slip_t != 0.0:
                    moved = (vy * nx - vx * ny) * dt - chord * radius
                aside = (v[2, i] - lever * roll[1, i]) * dt
                if wound:
                    aside += (v[2, i] * (tz - 1.0) + rising * tr) * dt
                if wound and lies and normal > 0.0:
                    # Over the cable below, which moves itself.
                    part = dt / normal
                    moved -= part * below[PUSHES + 10, i] * radius
                    aside -= part * (below[PUSHES + 8, i] * tr + below[PUSHES + 9, i] * tz)
            slip_t += moved
            slip_z += aside
            grip = 0.0
            ft, fz = -stick * slip_t, -stick * slip_z
            size = ft * ft + fz * fz
            most = k.friction * normal
            way = moved * moved + aside * aside
            if size > most * most:
                # What moved against the spring and is not stored in it any more has become heat.
                sliding += 0.5 * ((size - most * most) * per_stick - stick * way)
                scale = most / math.sqrt(size)
                ft *= scale
                fz *= scale
                slip_t *= scale
                slip_z *= scale
            else:
                grip = dashpot
                ft -= dashpot * moved
                fz -= dashpot * aside
            slip[0, i] = slip_t
            slip[1, i] = slip_z
            work += ft * radius
            radial, axial = normal, fz
            if wound:
                radial, axial = up + fz * tr, along_z + fz * tz
            if wound and lies and normal > 0.0:
                share = 1.0 / normal
                work -= _rub(i, share * ft * radius, share * fz * tr, share * fz * tz, points, net)
                ft += below[PUSHES + 4, i]
            net[0, i] += radial * nx - ft * ny
            net[1, i] += radial * ny + ft * nx
            net[2, i] += axial
            gained = 0.5 * dt / mass[i]
            pushed = gained * (net[0, i] * nx + net[1, i] * ny)
            bouncing -= damped * (outward + pushed)
            across = gained * net[2, i]
            if wound:
                across = across * tz + pushed * tr
            if grip > 0.0:
                along = gained * dt * (net[1, i] * nx - net[0, i] * ny)
                along -= 0.5 * (turning - turned) * radius
                sliding += grip * (way + moved * along + aside * dt * across)
            couple[i] = -fz * lever
        if wound:
            bouncing += _bounced(begin, end, dt, 0.5 * (turned + turning), points, mass, net)
        ledger[WORK_SURFACE] += 0.5 * work * (turned + turning)
        ledger[LOSS_FRICTION] += sliding
        ledger[LOSS_CONTACT] += bouncing * dt

    touch.__qualname__ = "touch_wound" if wound else "touch_cylinder"
    return kernel(touch)


touch_cylinder = _touching(wound=False)
touch_wound = _touching(wound=True)


@called
def _rates(i: int, dt: float, turned: float, points: Points) -> tuple[float, float, float]:
    """Return radius [m] of a node and the rates of it [m/s] and of its angle over the surface."""
    x, v = points.position, points.velocity
    px, py, vx, vy = x[0, i], x[1, i], v[0, i], v[1, i]
    radius = math.sqrt(px * px + py * py)
    rising = (vx * px + vy * py - 0.5 * dt * (vx * vx + vy * vy)) / radius
    return radius, rising, (vy * px - vx * py) / (radius * radius) - math.sin(turned) / dt


@called
def _press(
    begin: int,
    end: int,
    dt: float,
    surface: Surface,
    points: Points,
    net: FloatArray,
    k: ContactLaw,
) -> float:
    """Write how the cable below pushes nodes, see `Points.below`, and push it back where it moves.

    Args:
        begin: First node.
        end: Last node + 1.
        dt: Time step [s].
        surface: Of the cylinder.
        points: The nodes.
        net: Net forces [N], shape (3, nodes), added to for what lies below.
        k: Constants.

    Returns:
        the torque of cable at rest on the nodes [N m].
    """
    x, v, below = points.position, points.velocity, points.below
    torque = 0.0
    below[PUSHES:, begin:end] = 0.0
    for i in range(begin, end):
        if points.touching[i] == 0:
            points.contact_radius[i] = surface.landing
        if below[4, i] == 0.0:
            continue
        # A node's radius is larger by what makes up for chords, and for the depth of the springs:
        # in a valley that is twice as large as on the cylinder.
        radius, rising, turns = _rates(i, dt, surface.turned, points)
        lower = (2.0 * points.contact_radius[i] - k.chords - k.line) * k.line / radius
        deeper = 1.0 + lower / radius
        for first in range(0, GONE, BELOW_ROWS):
            at, there = below[first, i], below[first + 1, i]
            rise, slope, apart = below[first + 2, i], below[first + 3, i], below[first + 4, i]
            if apart == 0.0:
                break
            per_radian = at * at + rise * rise + slope * slope
            j, share = int(below[first + 5, i]), below[first + 6, i]
            gone, rate, sinking, speed, going = below[GONE, i], 0.0, 0.0, 0.0, 0.0
            if j >= 0:
                at, there = 0.0, 0.0
                for e, part in ((j, 1.0 - share), (j + 1, share)):
                    r, up, turning = _rates(e, dt, surface.turned, points)
                    chords = (k.chords - k.line) * k.line / r
                    at += part * (r - chords)
                    there += part * x[2, e]
                    gone -= part * below[GONE, e]
                    sinking += part * up
                    rate += part * up * (1.0 + chords / r)
                    speed += part * v[2, e]
                    going += part * turning
            a = radius - lower - at - rise * gone
            b = x[2, i] - there - slope * gone
            along = (a * rise + b * slope) / per_radian
            square = a * a + b * b - along * (a * rise + b * slope)
            below[first + 7, i] = 0.0
            if square >= apart * apart:
                continue
            far = math.sqrt(square)
            a, b = (a - along * rise) / far, (b - along * slope) / far
            c = a * rise + b * slope
            elastic = k.beside_stiffness * (apart - far)
            parting = a * (deeper * rising - rate) + b * (v[2, i] - speed) + c * (turns - going)
            push = max(elastic - k.beside_damping * parting, 0.0)
            damped = push - elastic
            below[first + 7, i] = push
            below[PUSHES, i] = 1.0
            below[PUSHES + 1, i] += push
            below[PUSHES + 2, i] += push * a * deeper
            below[PUSHES + 3, i] += push * b
            below[PUSHES + 4, i] += push * c / radius
            below[PUSHES + 5, i] += damped * a * deeper
            below[PUSHES + 6, i] += damped * b
            below[PUSHES + 7, i] += damped * c / radius
            if j < 0:
                torque += push * c
                continue
            below[PUSHES + 8, i] += push * sinking
            below[PUSHES + 9, i] += push * speed
            below[PUSHES + 10, i] += push * going
            for e, part in ((j, 1.0 - share), (j + 1, share)):
                r = math.sqrt(x[0, e] * x[0, e] + x[1, e] * x[1, e])
                up = part * a * (1.0 + (k.chords - k.line) * k.line / (r * r))
                _add(e, -push * up, -push * part * b, -push * part * c / r, points, net)
                below[PUSHES + 5, e] -= damped * up
                below[PUSHES + 6, e] -= damped * part * b
                below[PUSHES + 7, e] -= damped * part * c / r
    return torque


@called
def _add(i: int, up: float, along: float, around: float, points: Points, net: FloatArray) -> None:
    """Add a force [N] along radius, axis and circumference to the net force of a node."""
    px, py = points.position[0, i], points.position[1, i]
    inverse = 1.0 / math.sqrt(px * px + py * py)
    net[0, i] += (up * px - around * py) * inverse
    net[1, i] += (up * py + around * px) * inverse
    net[2, i] += along


@called
def _rub(i: int, torque: float, up: float, along: float, points: Points, net: FloatArray) -> float:
    """Rub the moving cable below a node as that rubs the node; return the torque on it [N m].

    Args:
        i: Number of the node.
        torque: Of friction on the node, for each newton of push [m].
        up: Radial part of friction, for each newton of push.
        along: Axial part, for each newton of push.
        points: The nodes.
        net: Net forces [N], shape (3, nodes), added to for what lies below.
    """
    x, below = points.position, points.below
    total = 0.0
    for first in range(0, GONE, BELOW_ROWS):
        if below[first + 4, i] == 0.0:
            break
        j, share, push = int(below[first + 5, i]), below[first + 6, i], below[first + 7, i]
        if j < 0 or push == 0.0:
            continue
        total += push
        for e, part in ((j, 1.0 - share), (j + 1, share)):
            r = math.sqrt(x[0, e] * x[0, e] + x[1, e] * x[1, e])
            less = -push * part
            _add(e, less * up, less * along, less * torque / r, points, net)
    return torque * total


@called
def _bounced(
    begin: int, end: int, dt: float, turning: float, points: Points, mass: FloatArray,
    net: FloatArray,
) -> float:  # fmt: skip
    """Return what the dashpots between cable and cable take [W], once all net forces are known."""
    x, v, below = points.position, points.velocity, points.below
    taken = 0.0
    for i in range(begin, end):
        up, along, around = below[PUSHES + 5, i], below[PUSHES + 6, i], below[PUSHES + 7, i]
        if up == 0.0 and along == 0.0 and around == 0.0:
            continue
        gained = 0.5 * dt / mass[i]
        vx, vy = v[0, i] + gained * net[0, i], v[1, i] + gained * net[1, i]
        radius = math.sqrt(x[0, i] * x[0, i] + x[1, i] * x[1, i])
        taken -= up * (vx * x[0, i] + vy * x[1, i]) / radius
        taken -= along * (v[2, i] + gained * net[2, i])
        taken -= around * ((vy * x[0, i] - vx * x[1, i]) / radius - turning * radius / dt)
    return taken


@called
def go_along(begin: int, end: int, dt: float, turned: float, points: Points) -> float:
    """Add up how far nodes go over the cable below; return the farthest since the look [rad].

    Args:
        begin: First node.
        end: Last node + 1.
        dt: Time step [s], over.
        turned: Rotation of the cylinder in it [rad].
        points: The nodes.
    """
    x, v, below = points.position, points.velocity, points.below
    chord, farthest = math.sin(turned), 0.0
    for i in range(begin, end):
        square = x[0, i] * x[0, i] + x[1, i] * x[1, i]
        below[GONE, i] -= dt * (v[1, i] * x[0, i] - v[0, i] * x[1, i]) / square - chord
        if below[4, i] > 0.0:
            farthest = max(farthest, abs(below[GONE, i]))
    return farthest


@called
def touch_flanges(
    begin: int, end: int, dt: float, points: Points, mass: FloatArray, net: FloatArray,
    k: ContactLaw, ledger: FloatArray,
) -> None:  # fmt: skip
    """Add the push of the drum's flanges, without friction, to the net forces of nodes within.

    Args:
        begin: First node.
        end: Last node + 1.
        dt: Time step [s].
        points: The nodes.
        mass: Of the nodes [kg].
        net: Net forces [N], shape (3, nodes), added to.
        k: Constants.
        ledger: Energies [J], added to.
    """
    x, v = points.position, points.velocity
    square = k.rim * k.rim
    for i in range(begin, end):
        z, beyond = x[2, i], x[0, i] * x[0, i] + x[1, i] * x[1, i] - square
        if k.low <= z <= k.high or beyond >= 0.0:
            continue
        elastic = k.beside_stiffness * (k.low - z if z < k.low else k.high - z)
        if beyond >= 2.0 * dt * (v[0, i] * x[0, i] + v[1, i] * x[1, i]):
            # It has come in over the rim.
            ledger[WORK_SURFACE] += 0.5 * elastic * elastic / k.beside_stiffness
        speed = v[2, i]
        push = elastic - k.beside_damping * speed
        push = max(push, 0.0) if z < k.low else min(push, 0.0)
        net[2, i] += push
        ledger[LOSS_CONTACT] -= (push - elastic) * (speed + 0.5 * dt / mass[i] * net[2, i]) * dt
