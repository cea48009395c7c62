"""Contact with a turning rigid cylinder about the z axis, and with the cable that is wound on it.

Penalty, Coulomb, stick with memory.
"""

import math
from collections.abc import Callable

from cable_fem_node.dynamics.compile import called, kernel
from cable_fem_node.dynamics.state import (
    BELOW_ROWS,
    DAMPED,
    GONE,
    INVERSE,
    LOADS,
    LOSS_CONTACT,
    LOSS_FRICTION,
    PUSHES,
    RATES,
    WORK_SURFACE,
    ContactLaw,
    FloatArray,
    Points,
    Surface,
)

_RETURN = 0.25  # Share of its depth by which a landing node comes back in a step at most


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
            dt: Step before [s].
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
            work = _press(begin, end, dt, surface, points, k)
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
            gives = wound and below[PUSHES, i] > 1.0
            if wound:
                inverse = below[INVERSE, i]
                up, around = below[LOADS, i] * inverse, below[LOADS + 2, i] * inverse
                net[0, i] += up * px - around * py
                net[1, i] += up * py + around * px
                net[2, i] += below[LOADS + 1, i]
            if not held:
                if square >= square_landing and not lies:
                    continue
                touching[i] = 1
                contact_radius[i] = surface.landing
            radius = below[RATES, i] if wound else math.sqrt(square)
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
            if not wound:
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
                up, along_z, tr, tz = normal, 0.0, 0.0, 1.0
                if lies:
                    up, along_z = normal + below[PUSHES + 2, i], below[PUSHES + 3, i]
                    normal += below[PUSHES + 1, i]
                if along_z != 0.0:
                    whole = 1.0 / math.sqrt(up * up + along_z * along_z)
                    tr, tz = -along_z * whole, up * whole
            moved, aside = 0.0, 0.0
            if held:
                if i < surface.gripped or slip_t != 0.0:
                    moved = (vy * nx - vx * ny) * dt - chord * radius
                aside = (v[2, i] - lever * roll[1, i]) * dt
                if wound:
                    aside += (v[2, i] * (tz - 1.0) + rising * tr) * dt
                if wound and gives and normal > 0.0:
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
            if wound and gives and normal > 0.0:
                # The moving cable below is rubbed as it rubs.
                for first in range(0, GONE, BELOW_ROWS):
                    if below[first + 4, i] == 0.0:
                        break
                    j, share = int(below[first + 5, i]), below[first + 6, i]
                    if j < 0:
                        continue
                    less = below[first + 7, i] / normal
                    work -= less * ft * radius
                    for e, part in ((j, less * (1.0 - share)), (j + 1, less * share)):
                        below[LOADS, e] -= part * fz * tr
                        below[LOADS + 1, e] -= part * fz * tz
                        below[LOADS + 2, e] -= part * ft * radius * below[INVERSE, e]
            if wound and lies:
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
def _note_rates(i: int, dt: float, chord: float, points: Points) -> None:
    """Write the radius of a node, its rates and that of its angle over the surface, clear loads."""
    below = points.below
    px, py = points.position[0, i], points.position[1, i]
    vx, vy = points.velocity[0, i], points.velocity[1, i]
    square = px * px + py * py
    inverse = 1.0 / math.sqrt(square)
    below[RATES, i] = square * inverse
    below[RATES + 1, i] = (vx * px + vy * py - 0.5 * dt * (vx * vx + vy * vy)) * inverse
    below[RATES + 2, i] = (vy * px - vx * py) * inverse * inverse - chord
    below[INVERSE, i] = inverse
    below[PUSHES, i] = 0.0
    for row in range(DAMPED, DAMPED + 3):
        below[row, i] = 0.0
    for row in range(LOADS, RATES):
        below[row, i] = 0.0


@called
def _press(
    begin: int, end: int, dt: float, surface: Surface, points: Points, k: ContactLaw
) -> float:
    """Write how cable below pushes nodes, see `Points.below`, and is pushed back where it moves.

    Args:
        begin: First node.
        end: Last node + 1.
        dt: Time step [s].
        surface: Of the cylinder.
        points: The nodes.
        k: Constants.

    Returns:
        the torque of cable at rest on the nodes [N m].
    """
    x, v, below = points.position, points.velocity, points.below
    torque = 0.0
    lower_line = (k.chords - k.line) * k.line
    chord = math.sin(surface.turned) / dt
    for i in range(begin, end):
        # What lies below comes before.
        _note_rates(i, dt, chord, points)
        if points.touching[i] == 0:
            points.contact_radius[i] = surface.landing
        if below[4, i] == 0.0:
            continue
        # A node's radius is larger by what makes up for chords, and for the depth of the springs:
        # in a valley that is twice as large as on the cylinder.
        radius, inverse, speed_z = below[RATES, i], below[INVERSE, i], v[2, i]
        lower = (2.0 * points.contact_radius[i] - k.chords - k.line) * k.line * inverse
        deeper = 1.0 + lower * inverse
        lies, pushes, outward, axial, around = 0.0, 0.0, 0.0, 0.0, 0.0
        damped_up, damped_z, damped_around = 0.0, 0.0, 0.0
        raised, carried, swept, went = 0.0, 0.0, 0.0, below[GONE, i]
        for first in range(0, GONE, BELOW_ROWS):
            at, there = below[first, i], below[first + 1, i]
            rise, slope, apart = below[first + 2, i], below[first + 3, i], below[first + 4, i]
            if apart == 0.0:
                break
            per_square, gone = below[first + 8, i], went
            j, share, rest = int(below[first + 5, i]), 0.0, 1.0
            if j >= 0:
                below[first + 7, i], share = 0.0, below[first + 6, i]
                rest -= share
                at = rest * _centre(j, k, below) + share * _centre(j + 1, k, below)
                there = rest * x[2, j] + share * x[2, j + 1]
                gone -= rest * below[GONE, j] + share * below[GONE, j + 1]
            a = radius - lower - at - rise * gone
            b = x[2, i] - there - slope * gone
            along = a * rise + b * slope
            square = a * a + b * b
            square -= along * along * per_square
            if square >= apart * apart:
                continue
            along *= per_square
            far = math.sqrt(square)
            per_far = 1.0 / far
            a, b = (a - along * rise) * per_far, (b - along * slope) * per_far
            c = a * rise + b * slope
            rate, sinking, speed, going = 0.0, 0.0, 0.0, 0.0
            if j >= 0:
                for e, part in ((j, rest), (j + 1, share)):
                    per_r, up = below[INVERSE, e], part * below[RATES + 1, e]
                    sinking += up
                    rate += up * (1.0 + lower_line * per_r * per_r)
                    speed += part * v[2, e]
                    going += part * below[RATES + 2, e]
            elastic = k.beside_stiffness * (apart - far)
            parting = a * (deeper * below[RATES + 1, i] - rate) + b * (speed_z - speed)
            parting += c * (below[RATES + 2, i] - going)
            push = max(elastic - k.beside_damping * parting, 0.0)
            damped = push - elastic
            lies = max(lies, 1.0)
            pushes += push
            outward += push * a
            axial += push * b
            around += push * c
            damped_up += damped * a
            damped_z += damped * b
            damped_around += damped * c
            if j < 0:
                torque += push * c
                continue
            lies, below[first + 7, i] = 2.0, push
            raised += push * sinking
            carried += push * speed
            swept += push * going
            for e, part in ((j, rest), (j + 1, share)):
                per_r = below[INVERSE, e]
                up, turns = part * a * (1.0 + lower_line * per_r * per_r), part * c * per_r
                below[LOADS, e] -= push * up
                below[LOADS + 1, e] -= push * part * b
                below[LOADS + 2, e] -= push * turns
                below[DAMPED, e] -= damped * up
                below[DAMPED + 1, e] -= damped * part * b
                below[DAMPED + 2, e] -= damped * turns
        if lies > 0.0:
            below[PUSHES, i], below[PUSHES + 1, i] = lies, pushes
            below[PUSHES + 2, i], below[PUSHES + 3, i] = outward * deeper, axial
            below[PUSHES + 4, i] = around * inverse
            below[DAMPED, i], below[DAMPED + 1, i] = damped_up * deeper, damped_z
            below[DAMPED + 2, i] = damped_around * inverse
            below[PUSHES + 8, i], below[PUSHES + 9, i], below[PUSHES + 10, i] = (
                raised,
                carried,
                swept,
            )
    return torque


@called
def _centre(i: int, k: ContactLaw, below: FloatArray) -> float:
    """Return the radius of the centre line at a node, which chords join [m]."""
    radius: float = below[RATES, i] - (k.chords - k.line) * k.line * below[INVERSE, i]
    return radius


@called
def _bounced(
    begin: int, end: int, dt: float, turning: float, points: Points, mass: FloatArray,
    net: FloatArray,
) -> float:  # fmt: skip
    """Return what the dashpots between cable and cable take [W], once all net forces are known."""
    x, v, below = points.position, points.velocity, points.below
    taken, turns = 0.0, turning / dt
    for i in range(begin, end):
        gained, inverse = 0.5 * dt / mass[i], below[INVERSE, i]
        vx, vy = v[0, i] + gained * net[0, i], v[1, i] + gained * net[1, i]
        taken -= below[DAMPED, i] * (vx * x[0, i] + vy * x[1, i]) * inverse
        taken -= below[DAMPED + 1, i] * (v[2, i] + gained * net[2, i])
        around = (vy * x[0, i] - vx * x[1, i]) * inverse - turns * below[RATES, i]
        taken -= below[DAMPED + 2, i] * around
    return taken


@called
def go_along(begin: int, end: int, dt: float, turned: float, points: Points, most: float) -> int:
    """Add up how far nodes go over the cable below; return how many have gone too far.

    Args:
        begin: First node.
        end: Last node + 1.
        dt: Time step [s], over.
        turned: Rotation of the cylinder in it [rad].
        points: The nodes.
        most: How far they may go since the look [rad].
    """
    x, v, below = points.position, points.velocity, points.below
    chord, beyond = math.sin(turned), 0
    # A count, unlike a maximum, lets the loop take several nodes at once.
    for i in range(begin, end):
        square = x[0, i] * x[0, i] + x[1, i] * x[1, i]
        gone = below[GONE, i] - dt * (v[1, i] * x[0, i] - v[0, i] * x[1, i]) / square + chord
        below[GONE, i] = gone
        beyond += (below[4, i] > 0.0) & (abs(gone) > most)
    return beyond


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
