"""The winding machine's own kernel: a rod between a turning cylinder and a guide that feeds it.

One call advances many central-difference steps. Node 0 turns with the cylinder and holds the
direction of the cable there: it is P0, or the last node of the cable that rests on the surface. The
last node is the guide's eye. The last element stands for the cable that slides through the eye: it
pulls with the span tension whatever its length, and elements are cut from it (or given back to it)
as the cable is drawn in.
"""

import math

import numpy as np

from cable_fem_node.dynamics.compile import called, kernel
from cable_fem_node.dynamics.contact_kernels import (
    go_along,
    touch_cylinder,
    touch_flanges,
    touch_wound,
)
from cable_fem_node.dynamics.state import (
    LOSS_DAMPING,
    LOSS_RELAXATION,
    WORK_INFLOW,
    WORK_SPAN,
    WORK_TIE,
    FloatArray,
    IntArray,
    Points,
    Surface,
)
from cable_fem_node.rod.relaxation import branch_energy, decays, relax_elements, strain_under
from cable_fem_node.rod.rod_kernels import (
    bend_end,
    bend_nodes,
    element_force,
    empty_work,
    law_energy,
    roll_nodes,
    stretch_elements,
)
from cable_fem_node.rod.rod_records import (
    ANGLE,
    CUT_AT,
    DIVERGED,
    EMPTY,
    EYE_X,
    EYE_Y,
    FEED,
    FULL,
    GUIDE,
    LANDING,
    LOOK,
    MERGE_AT,
    REFERENCE,
    RUNNING,
    SPEED,
    STIRRED,
    STIRRED_ON_CABLE,
    STRETCH,
    TENSION,
    TIE_ALONG,
    TIE_PLACE,
    TIE_WATCHED,
    VISCOUS,
    AxialResponse,
    Constants,
    Relaxation,
    RodState,
)
from winding_core.cable.material_law import TABLE_HIGH, TABLE_LOW

# A node looks anew for cable below when it has gone so far over it, in distances of centre lines.
GONE_AT = 0.1


@called
def points_of(rows: FloatArray, touching: IntArray, below: FloatArray) -> Points:
    """Return the nodes of a state, see `RodState`, as views."""
    return Points(
        position=rows[0:3],
        velocity=rows[3:6],
        slip=rows[6:8],
        contact_radius=rows[8],
        touching=touching,
        roll=rows[9:11],
        below=below,
    )


@called
def move_nodes(
    elements: int,
    dt: float,
    kick: float,
    rate: float,
    guide_speed: tuple[float, float, float],
    cable: Points,
    tangent: FloatArray,
    net: FloatArray,
    k: Constants,
) -> float:
    """Take one central-difference step of the inner nodes; return the damping loss [J].

    Mass-proportional damping acts on the velocity relative to the motion that is meant: with
    the surface where the cable lies on it, along the cable's own line with the feed where it
    does not. Damping towards the lab frame would add false tension, and damping towards the
    straight span would press a stiff cable, which lands on a curve, against the cylinder. What
    the guide's velocity [m/s] has across the span turns the span; along it cable slips through.
    Forces act for the mean of the steps that meet where they are taken, `kick` [s].
    """
    x, v = cable.position, cable.velocity
    half = 0.5 * k.damping_rate * kick
    decay = (1.0 - half) / (1.0 + half)
    push = kick / (k.mass * (1.0 + half))
    feed = -0.5 * k.contact_line * rate
    dx, dy = tangent[0, elements - 1], tangent[1, elements - 1]
    turning = (guide_speed[1] * dx - guide_speed[0] * dy) / k.free_length
    follow = -guide_speed[2] / k.free_length
    loss = 0.0
    for i in range(1, elements):
        px, py = x[0, i], x[1, i]
        wound = cable.touching[i] == 1
        rx = -rate * py if wound else feed * (tangent[0, i - 1] + tangent[0, i]) + turning * dy * py
        ry = rate * px if wound else feed * (tangent[1, i - 1] + tangent[1, i]) - turning * dx * py
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
    return k.mass * k.damping_rate * kick * loss


@called
def landing_node(elements: int, touching: IntArray) -> int:
    """Return the outermost node that touches, 0 for none."""
    node = elements - 1
    while node > 0 and touching[node] == 0:
        node -= 1
    return node


@called
def reached(edge: int, elements: int, square_landing: float, cable: Points) -> int:
    """Return one past the last node that touches, lands (radius squared) or has cable below."""
    end = elements
    while end > edge + 1 and cable.below[4, end - 1] == 0.0:
        x, y = cable.position[0, end - 1], cable.position[1, end - 1]
        if x * x + y * y < square_landing:
            break
        end -= 1
    return max(end, 2)


@called
def hermite(a: float, b: float, da: float, db: float, u: float) -> float:
    """Return the cubic through two values with slopes per unit of u."""
    step = b - a
    return a + u * (da + u * (3.0 * step - 2.0 * da - db + u * (da + db - 2.0 * step)))


@kernel
def advance_winding(
    rod: RodState,
    steps: int,
    dt: float,
    before: float,
    surface_rate: float,
    drive: FloatArray,
    k: Constants,
    response: AxialResponse,
    relax: Relaxation,
    ledger: FloatArray,
) -> tuple[int, int, float, int, int]:
    """Advance the cable by equal steps while the drive runs from its first to its second column.

    Python makes an `Advance` of what is returned: a record that is made while the kernel returns
    runs Python, where what a signal's handler raises would end the process.

    Args:
        rod: Nodes and elements, changed, and how the cylinder holds node 0.
        steps: Number of steps to take.
        dt: Step [s].
        before: Length of the step before the first [s], in which velocities are at its middle.
        surface_rate: Angular speed of the cylinder in the step before the first [rad/s].
        drive: Shape (9, 2), rows ANGLE .. EYE_Y.
        k: Constants.
        response: Axial response of the cable.
        relax: How the axial stress fades; with terms the last element stands for the cable before
            the guide, which the span's tension has loaded since the run began.
        ledger: Energies [J], added to in place.

    Returns:
        Fields of `Advance`.
    """
    nodes, touching, tie, watched, room = rod.nodes, rod.touching, rod.tie, rod.watched, rod.room
    cable, reference, viscous = (
        points_of(rod.rows, touching, rod.below),
        rod.rows[REFERENCE],
        rod.rows[VISCOUS:],
    )
    terms = relax.share.shape[0]
    decay, ramp = np.zeros(terms), np.zeros(terms)
    decays(dt, relax, decay, ramp)
    x, v = cable.position, cable.velocity
    capacity = touching.shape[0]
    work = empty_work(capacity)
    tangent, inverse, slope = work.tangent, work.inverse, work.slope
    force, net = work.force, work.net
    mass = np.full(capacity, k.mass)
    span = steps * dt
    first = np.zeros(3)
    free = np.zeros(3)
    angle = drive[ANGLE, 0]
    cosine, sine = math.cos(angle), math.sin(angle)
    first[2] = tie[TIE_ALONG, 2]
    taken, status = steps, RUNNING
    lies, touch = cable.below.shape[0] > 0, k.touch
    stirred = STIRRED_ON_CABLE * k.touch.apart if lies else k.stirred

    for step in range(steps):
        # A step is not begun that could not end with an element cut.
        if nodes == capacity:
            return nodes, step, surface_rate, FULL, nodes - 2
        u = step / steps
        pull = drive[TENSION, 0] + u * (drive[TENSION, 1] - drive[TENSION, 0])
        pulled = drive[STRETCH, 0] + u * (drive[STRETCH, 1] - drive[STRETCH, 0])
        landing = drive[LANDING, 0] + u * (drive[LANDING, 1] - drive[LANDING, 0])
        share = (step + 1.0) / steps
        next_angle = hermite(
            drive[ANGLE, 0], drive[ANGLE, 1], drive[SPEED, 0] * span, drive[SPEED, 1] * span, share
        )
        next_guide = hermite(
            drive[GUIDE, 0], drive[GUIDE, 1], drive[FEED, 0] * span, drive[FEED, 1] * span, share
        )
        rotation = next_angle - angle
        rate = rotation / dt
        elements = nodes - 1
        end = elements - 1

        stretch_elements(elements, x, reference, response, work)
        if terms > 0:
            ledger[LOSS_RELAXATION] += relax_elements(
                elements, cable, reference, viscous, decay, ramp, relax, k, work
            )
            held = pull
            for j in range(1, terms + 1):
                held += viscous[j, end]
            if not held < relax.high:
                return nodes, step + 1, surface_rate, DIVERGED, end
            pulled = 1.0 + strain_under(held, relax)
        work.tension[end] = pull
        bend_nodes(elements, reference, k.bending, work)
        first[0] = cosine * tie[TIE_ALONG, 0] - sine * tie[TIE_ALONG, 1]
        first[1] = sine * tie[TIE_ALONG, 0] + cosine * tie[TIE_ALONG, 1]
        bend_end(0, 0, first, rod.tie_length, k.bending, work)
        work.cosine[elements] = 0.0
        slope[elements] = 0.0
        element_force(elements, first, free, work)

        for c in range(3):
            for i in range(1, elements):
                net[c, i] = force[c, i] - force[c, i - 1]
        edge = landing_node(elements, touching)
        surface = Surface(
            turned=surface_rate * before,
            turning=rotation,
            landing=landing,
            rolling=k.rolling,
            edge=edge,
            # Cable that creeps would creep on while its node is free, by more than bending takes.
            gripped=edge - k.late if rate > 0.0 and terms == 0 else nodes,
        )
        if lies:
            # Of the span nothing touches.
            near = reached(edge, elements, landing * landing, cable)
            touch_wound(1, near, before, surface, cable, mass, net, work.couple, touch, ledger)
        else:
            touch_cylinder(
                1, elements, before, surface, cable, mass, net, work.couple, touch, ledger
            )
        if k.touch.low > -math.inf:
            touch_flanges(1, elements, before, cable, mass, net, k.touch, ledger)
        if k.rolling:
            roll_nodes(elements, dt, cable, work, k)
        next_x = drive[EYE_X, 0] + share * (drive[EYE_X, 1] - drive[EYE_X, 0])
        next_y = drive[EYE_Y, 0] + share * (drive[EYE_Y, 1] - drive[EYE_Y, 0])
        guide_speed = (
            (next_x - x[0, elements]) / dt,
            (next_y - x[1, elements]) / dt,
            (next_guide - x[2, elements]) / dt,
        )
        # The guide pulls along the last element and pushes the cable that bends at it aside.
        aside_x = force[0, end] - pull * tangent[0, end]
        aside_y = force[1, end] - pull * tangent[1, end]
        aside = force[2, end] - pull * tangent[2, end]
        done = pull * along(tangent, v, end) + aside * v[2, elements]
        done += aside_x * v[0, elements] + aside_y * v[1, elements]
        kick = 0.5 * (before + dt)
        ledger[LOSS_DAMPING] += move_nodes(
            elements, dt, kick, rate, guide_speed, cable, tangent, net, k
        )
        follows = pull * along(tangent, v, end) + aside * guide_speed[2]
        follows += aside_x * guide_speed[0] + aside_y * guide_speed[1]
        ledger[WORK_SPAN] += 0.5 * (before * done + dt * follows)

        # Prescribed ends: node 0 and its clamp turn with the surface, the guide goes as it is led.
        angle = next_angle
        cosine, sine = math.cos(angle), math.sin(angle)
        tie_x = cosine * tie[TIE_PLACE, 0] - sine * tie[TIE_PLACE, 1]
        tie_y = sine * tie[TIE_PLACE, 0] + cosine * tie[TIE_PLACE, 1]
        moment = slope[0] * (first[0] * tangent[1, 0] - first[1] * tangent[0, 0])
        ledger[WORK_TIE] -= 0.5 * force[0, 0] * (tie_x - x[0, 0] + before * v[0, 0])
        ledger[WORK_TIE] -= 0.5 * force[1, 0] * (tie_y - x[1, 0] + before * v[1, 0])
        ledger[WORK_TIE] += 0.5 * moment * (rotation + surface_rate * before)
        x[0, 0], x[1, 0], x[2, 0] = tie_x, tie_y, tie[TIE_PLACE, 2]
        v[0, 0], v[1, 0], v[2, 0] = -rate * tie_y, rate * tie_x, 0.0
        x[0, elements], x[1, elements], x[2, elements] = next_x, next_y, next_guide
        v[0, elements], v[1, elements], v[2, elements] = guide_speed
        surface_rate, before = rate, dt

        ex = x[0, elements] - x[0, end]
        ey = x[1, elements] - x[1, end]
        ez = x[2, elements] - x[2, end]
        length = math.sqrt(ex * ex + ey * ey + ez * ez)
        last = length / pulled
        if not 0.0 < last < 1.0e3 * k.segment:
            return nodes, step + 1, surface_rate, DIVERGED, end
        if last > CUT_AT * k.segment:
            part = k.segment / last
            for c in range(3):
                x[c, nodes] = x[c, elements]
                v[c, nodes] = v[c, elements]
                x[c, elements] = x[c, end] + part * (x[c, nodes] - x[c, end])
                v[c, elements] = v[c, end]
            cable.roll[0, elements] = cable.roll[0, end]
            cable.roll[1, elements] = cable.roll[1, end]
            work.couple[elements] = 0.0
            cable.touching[elements] = 0
            cable.slip[0, elements] = 0.0
            cable.slip[1, elements] = 0.0
            cable.contact_radius[elements] = 0.0
            cable.touching[nodes] = 0
            reference[end] = k.segment
            reference[elements] = last - k.segment
            for j in range(viscous.shape[0]):
                viscous[j, elements] = viscous[j, end]
            ledger[WORK_INFLOW] += inflow(x, v, end, elements, k, response, viscous[:, end], relax)
            nodes += 1
        elif last < MERGE_AT * k.segment:
            if nodes < 4:
                return nodes, step + 1, surface_rate, EMPTY, end
            given_back = inflow(x, v, end - 1, end, k, response, viscous[:, end - 1], relax)
            ledger[WORK_INFLOW] -= given_back
            for j in range(viscous.shape[0]):
                viscous[j, end - 1] = viscous[j, end]
            for c in range(3):
                x[c, end] = x[c, elements]
                v[c, end] = v[c, elements]
            reference[end - 1] = k.segment + last
            cable.touching[end] = 0
            nodes -= 1
        else:
            reference[end] = last
        if watched > 0:
            rx = x[0, watched] - cosine * tie[TIE_WATCHED, 0] + sine * tie[TIE_WATCHED, 1]
            ry = x[1, watched] - sine * tie[TIE_WATCHED, 0] - cosine * tie[TIE_WATCHED, 1]
            rz = x[2, watched] - tie[TIE_WATCHED, 2]
            if not rx * rx + ry * ry + rz * rz <= stirred * stirred:
                return nodes, step + 1, surface_rate, STIRRED, 0
        outside = int(abs(angle - drive[ANGLE, 0]) * k.contact_line > rod.way)
        if lies:
            most = GONE_AT * k.touch.apart / k.contact_line
            outside += go_along(1, nodes - 1, dt, rotation, cable, most)
        if room.shape[0] > 0:
            for i in range(1, nodes - 1):
                low = x[0, i] * x[0, i] + x[1, i] * x[1, i] < room[0, i]
                outside += low | (x[2, i] < room[1, i]) | (x[2, i] > room[2, i])
        if outside > 0:
            taken, status = step + 1, LOOK
            break
    for i in range(nodes - 2):
        stretch = 1.0 / (inverse[i] * reference[i])
        if not TABLE_LOW < stretch < TABLE_HIGH:
            return nodes, taken, surface_rate, DIVERGED, i
    return nodes, taken, surface_rate, status, 0


@called
def along(direction: FloatArray, velocity: FloatArray, i: int) -> float:
    """Return the speed [m/s] of node i along a direction, column i of an array (3, n)."""
    speed: float = (
        direction[0, i] * velocity[0, i]
        + direction[1, i] * velocity[1, i]
        + direction[2, i] * velocity[2, i]
    )
    return speed


@called
def inflow(
    x: FloatArray,
    v: FloatArray,
    a: int,
    b: int,
    k: Constants,
    response: AxialResponse,
    column: FloatArray,
    relax: Relaxation,
) -> float:
    """Return the energy [J] of one segment between nodes a and b: strain, and motion of b or a."""
    ex = x[0, b] - x[0, a]
    ey = x[1, b] - x[1, a]
    ez = x[2, b] - x[2, a]
    stretch = math.sqrt(ex * ex + ey * ey + ez * ez) / k.segment
    motion = v[0, b] ** 2 + v[1, b] ** 2 + v[2, b] ** 2
    strain = law_energy(stretch, response)
    energy: float = response.area * k.segment * strain + 0.5 * k.mass * motion
    if relax.share.shape[0] > 0:
        energy += k.segment * branch_energy(stretch - 1.0, column, response, relax)
    return energy
