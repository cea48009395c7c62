"""Cable that is laid on itself, slowly and densely: a reference for `wound_surface.py`.

Nothing of the solver is in it. In the cylinder's frame the guide goes round it; nodes of all turns
are moved, and touch the nearest point in space of elements of other turns, which give way. Explicit
steps, a feed of a thirtieth of the transverse waves' speed; lengths in diameters, forces in span
tensions. Stiff cable on cylinders of less than about five diameters diverges.
"""

import math

import numba
import numpy as np

MOST = 24  # Elements that a node may touch until the next look.
AXIAL, FEED, DEPTH = 100.0, 1.0 / 30.0, 0.005


def dense_lay(
    turns: float,
    path: np.ndarray,
    *,
    radius: float,
    span: float,
    bending: float,
    friction: float,
    between: tuple[float, float] = (-math.inf, math.inf),
    feed: float = FEED,
    element: float | None = None,
) -> np.ndarray:
    """Return wound angle [rad], z and radius [diameters] of the laid cable's nodes, shape (3, n).

    Args:
        turns: To wind.
        path: Of the guide: angles of the cylinder [rad] and places, ascending, shape (2, k).
        radius: Of the centre line of cable on the cylinder [diameters], as all lengths.
        span: From the guide to the tangent point.
        bending: EI over tension and diameter squared.
        friction: Coulomb's coefficient.
        between: Least and largest z.
        feed: Speed of the cable over that of transverse waves.
        element: Length; None: half a diameter, or a thirtieth of the radius if that is longer.
    """
    h = element or max(0.5, radius / 30.0)
    x = np.zeros((int((math.tau * turns * 1.5 * radius + 2.0 * span) / h) + 64, 3))
    count = max(4, round(span / h)) + 1
    x[:count, 0], x[:count, 1] = radius, -np.linspace(0.0, span, count)
    h = span / (count - 1)
    stiff = h / (radius * DEPTH)
    most = 4.0 * AXIAL / h + 16.0 * bending / h**3 + 4.0 * stiff + 8.0 / h
    dt = 0.5 * math.sqrt(h / most)
    rate = feed / radius
    steps = int(math.tau * turns / rate / dt)
    n, held = _wind(
        x, count, steps, dt, rate, path, radius, span, h, bending, friction, stiff, *between
    )
    azimuth = -np.unwrap(np.arctan2(x[:n, 1], x[:n, 0]))
    last = int(np.flatnonzero(held[:n])[-1])
    return np.stack([azimuth, x[:n, 2], np.hypot(x[:n, 0], x[:n, 1])])[:, : last + 1]


@numba.njit(cache=True)
def _near(x, i, theta, out):
    """Write the elements of earlier turns that node i may touch."""
    found = 0
    for j in range(i):
        if theta[i] - theta[j + 1] < math.pi:
            break
        dx, dy, dz = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1], x[i, 2] - x[j, 2]
        ex, ey, ez = x[j + 1, 0] - x[j, 0], x[j + 1, 1] - x[j, 1], x[j + 1, 2] - x[j, 2]
        reach = 1.3 + math.sqrt(ex * ex + ey * ey + ez * ez)
        if dx * dx + dy * dy + dz * dz < reach * reach and found < MOST:
            out[i, found] = j
            found += 1
    out[i, found:] = -1


@numba.njit(cache=True)
def _along(x, i, j):
    """Return where node i is along element j, 0 at its begin and 1 at its end."""
    far = square = 0.0
    for c in range(3):
        e = x[j + 1, c] - x[j, c]
        far += (x[i, c] - x[j, c]) * e
        square += e * e
    return far / square


@numba.njit(cache=True)
def _wind(x, n, steps, dt, rate, path, radius, span, h, bending, friction, stiff, low, high):
    size = x.shape[0]
    v, f = np.zeros((size, 3)), np.zeros((size, 3))
    stick, rest = np.zeros((size, 3)), np.full(size, h / (1.0 + 1.0 / AXIAL))
    held, theta = np.zeros(size, dtype=np.bool_), np.zeros(size)
    near = np.full((size, MOST), -1)
    t, q, fr, push = np.zeros((size, 3)), np.zeros(3), np.zeros(3), np.zeros((MOST + 3, 3))
    size_of, share, at = np.zeros(MOST + 3), np.zeros(MOST), np.zeros(MOST, dtype=np.int64)
    first = np.array([0.0, -1.0, 0.0])
    length = np.zeros(size)
    eta = 0.3 * math.sqrt(h * 4.0 / h)
    eta_n = 0.6 * math.sqrt(stiff * h)
    every = max(1, int(0.05 / (rate * radius * dt)))
    knot = 0
    for step in range(steps):
        angle = rate * dt * (step + 1)
        while knot + 2 < path.shape[1] and path[0, knot + 1] < angle:
            knot += 1
        u = (angle - path[0, knot]) / (path[0, knot + 1] - path[0, knot])
        zg = path[1, knot] + u * (path[1, knot + 1] - path[1, knot])
        co, si = math.cos(angle), math.sin(angle)
        g = n - 1
        gx, gy = co * radius - si * span, -si * radius - co * span
        v[g, 0], v[g, 1], v[g, 2] = (gx - x[g, 0]) / dt, (gy - x[g, 1]) / dt, (zg - x[g, 2]) / dt
        x[g, 0], x[g, 1], x[g, 2] = gx, gy, zg
        if step % every == 0:
            theta[0] = 0.0
            for i in range(1, n):
                theta[i] = theta[i - 1] + math.atan2(
                    x[i - 1, 1] * x[i, 0] - x[i - 1, 0] * x[i, 1],
                    x[i - 1, 0] * x[i, 0] + x[i - 1, 1] * x[i, 1],
                )
            for i in range(1, n - 1):
                if theta[i] > math.pi:
                    _near(x, i, theta, near)
        f[:n] = 0.0
        for i in range(n - 1):
            l2 = 0.0
            for c in range(3):
                t[i, c] = x[i + 1, c] - x[i, c]
                l2 += t[i, c] * t[i, c]
            length[i] = math.sqrt(l2)
            t[i] /= length[i]
            pull = 1.0 if i == n - 2 else AXIAL * (length[i] / rest[i] - 1.0)
            for c in range(3):
                part = pull * t[i, c] + eta * (v[i + 1, c] - v[i, c])
                f[i, c] += part
                f[i + 1, c] -= part
        if bending > 0.0:
            for i in range(n - 1):
                # The clamp at P0 is half an angle over half a length.
                cosine = 0.0
                for c in range(3):
                    q[c] = first[c] if i == 0 else t[i - 1, c]
                    cosine += q[c] * t[i, c]
                sine = math.sqrt(max(1.0 - cosine * cosine, 1.0e-18))
                moment = bending / h * math.atan2(sine, cosine) / sine * (2.0 if i == 0 else 1.0)
                for c in range(3):
                    b = moment * (q[c] - cosine * t[i, c]) / length[i]
                    f[i + 1, c] += b
                    f[i, c] -= b
                    if i > 0:
                        a = moment * (t[i, c] - cosine * q[c]) / length[i - 1]
                        f[i, c] += a
                        f[i - 1, c] -= a
        for i in range(1, n - 1):
            r = math.sqrt(x[i, 0] ** 2 + x[i, 1] ** 2)
            count = on = 0
            if r < radius:
                rising = (x[i, 0] * v[i, 0] + x[i, 1] * v[i, 1]) / r
                size_of[0] = max(stiff * (radius - r) - eta_n * rising, 0.0)
                push[0, 0], push[0, 1], push[0, 2] = x[i, 0] / r, x[i, 1] / r, 0.0
                count = 1
            cylinder = count
            for m in range(MOST):
                j = near[i, m]
                if j < 0:
                    break
                s = _along(x, i, j)
                if s >= 1.0:
                    continue
                if j > 0:
                    before = _along(x, i, j - 1)
                    if before < 1.0 and (s < 0.0 or before >= 0.0):
                        continue
                s = max(s, 0.0)
                far = 0.0
                for c in range(3):
                    q[c] = x[i, c] - x[j, c] - s * (x[j + 1, c] - x[j, c])
                    far += q[c] * q[c]
                if far >= 1.0:
                    continue
                far = math.sqrt(far)
                speed = 0.0
                for c in range(3):
                    push[count, c] = q[c] / far
                    speed += push[count, c] * (v[i, c] - (1.0 - s) * v[j, c] - s * v[j + 1, c])
                size_of[count] = max(stiff * (1.0 - far) - eta_n * speed, 0.0)
                at[on], share[on] = j, s
                on += 1
                count += 1
            if x[i, 2] < low or x[i, 2] > high:
                deep = max(low - x[i, 2], 0.0) - max(x[i, 2] - high, 0.0)
                f[i, 2] += stiff * deep - eta_n * v[i, 2]
            held[i] = count > 0
            if count == 0:
                stick[i] = 0.0
                continue
            normal, whole = 0.0, 0.0
            for c in range(3):
                q[c] = 0.0
                for m in range(count):
                    q[c] += size_of[m] * push[m, c]
                whole += q[c] * q[c]
            for m in range(count):
                normal += size_of[m]
            whole = math.sqrt(max(whole, 1.0e-30))
            off = 0.0
            for c in range(3):
                stick[i, c] += dt * v[i, c]
                off += stick[i, c] * q[c] / whole
            most = 0.0
            for c in range(3):
                stick[i, c] -= off * q[c] / whole
                most += stick[i, c] ** 2
            most = stiff * math.sqrt(most)
            if most > friction * normal:
                stick[i] *= friction * normal / most
            for c in range(3):
                fr[c] = -stiff * stick[i, c]
                if most <= friction * normal:
                    fr[c] -= 0.3 * eta_n * v[i, c]
                f[i, c] += q[c] + fr[c]
            for m in range(on):
                part = size_of[cylinder + m] / max(normal, 1.0e-30)
                for c in range(3):
                    back = size_of[cylinder + m] * push[cylinder + m, c] + part * fr[c]
                    f[at[m], c] -= (1.0 - share[m]) * back
                    f[at[m] + 1, c] -= share[m] * back
        for i in range(1, n - 1):
            for c in range(3):
                v[i, c] += dt / h * f[i, c]
                x[i, c] += dt * v[i, c]
        gap = 0.0
        for c in range(3):
            gap += (x[n - 1, c] - x[n - 2, c]) ** 2
        gap = math.sqrt(gap) / (1.0 + 1.0 / AXIAL)
        if gap > 1.5 * h:
            if n == size:
                return n, held
            for c in range(3):
                x[n, c], v[n, c] = x[n - 1, c], v[n - 1, c]
                x[n - 1, c] = x[n - 2, c] + h / gap * (x[n, c] - x[n - 2, c])
                v[n - 1, c] = v[n - 2, c]
            rest[n - 2] = h
            near[n - 1] = -1
            n += 1
    return n, held
