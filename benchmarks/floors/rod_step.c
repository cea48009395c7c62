/* The explicit step of the wound rod in plain C, with the arithmetic of the project's kernel.
 *
 * A floor for that kernel's processor time: axial response from a table, bending, contact with
 * friction, damping in proportion to mass, the clamped first node, cutting and giving back of
 * elements at the guide, and the ledger. The cable does not roll. Arrays (rows, capacity); SI. */
#include <math.h>
#include <stdint.h>

enum { ANGLE, SPEED, GUIDE, FEED, TENSION, STRETCH, LANDING };
enum { TIE, SURFACE, SPAN, INFLOW, FRICTION, CONTACT, DAMPING };
enum { RUNNING, FULL, DIVERGED, EMPTY };

typedef struct {
    double segment, mass, bending, damping_rate, start_radius, contact_line, free_length;
    double normal_stiffness, normal_damping, stick_stiffness, stick_damping, friction;
    double table_low, per_spacing, area, series_limit, cut_at, merge_at;
} Constants;

typedef struct {
    double *position, *velocity, *slip, *contact_radius, *reference;
    int64_t *touching;
    double *tangent, *inverse, *tension, *cosine, *slope, *force, *net, *along;
    const double *table;
    int64_t table_rows, capacity;
} Arrays;

typedef struct {
    int64_t nodes, taken, status;
    double surface_step;
} State;

static inline double hermite(double a, double b, double da, double db, double u) {
    double step = b - a;
    return a + u * (da + u * (3.0 * step - 2.0 * da - db + u * (da + db - 2.0 * step)));
}

static inline double turning_series(double u) {
    double high = 0.0024864024864024864 + u * (0.0011700717524915897 + u * 0.00055424452486443733);
    double middle =
        0.025396825396825397 + u * (0.011544011544011544 + u * (0.0053280053280053280 + u * high));
    double low = 0.13333333333333333 + u * (0.057142857142857143 + u * middle);
    return 1.0 + u * (0.33333333333333333 + u * low);
}

static double turning_factor(double u, double limit) {
    if (u < limit) return turning_series(u);
    if (u >= 1.0) return 0.5 * M_PI;
    double c = 1.0 - u;
    return acos(c) / sqrt(1.0 - c * c);
}

/* Place in the table and, by the pointer, how far into its interval. */
static inline int32_t place_of(double stretch, int64_t rows, const Constants *k, double *u) {
    const double most = (double)rows - 1.0e-9;
    double place = (stretch - k->table_low) * k->per_spacing;
    place = place > 0.0 ? place : 0.0;
    place = place < most ? place : most;
    int32_t i = (int32_t)place;
    *u = place - (double)i;
    return 5 * i;
}

static double energy_of(double stretch, const Arrays *a, const Constants *k) {
    double u;
    const double *t = a->table + place_of(stretch, a->table_rows, k, &u);
    double rise = t[0] + u * (t[1] / 2.0 + u * (t[2] / 3.0 + u * t[3] / 4.0));
    return t[4] + u * rise / k->per_spacing;
}

static double inflow(const Arrays *a, const Constants *k, int64_t from, int64_t to) {
    const double *x = a->position, *v = a->velocity;
    double square = 0.0, motion = 0.0;
    for (int c = 0; c < 3; c++) {
        double edge = x[c * a->capacity + to] - x[c * a->capacity + from];
        square += edge * edge;
        motion += v[c * a->capacity + to] * v[c * a->capacity + to];
    }
    double stored = energy_of(sqrt(square) / k->segment, a, k);
    return k->area * k->segment * stored + 0.5 * k->mass * motion;
}

/* The compiler believes `restrict` of parameters, which is what lets it work on four at once. */
static void stretch_elements(int64_t elements, const double *restrict x, const double *restrict y,
                             const double *restrict z, const double *restrict reference,
                             double *restrict tx, double *restrict ty, double *restrict tz,
                             double *restrict inverse, double *restrict tension) {
    for (int64_t i = 0; i < elements; i++) {
        double ex = x[i + 1] - x[i], ey = y[i + 1] - y[i], ez = z[i + 1] - z[i];
        double length = sqrt(ex * ex + ey * ey + ez * ez), inv = 1.0 / length;
        tx[i] = ex * inv, ty[i] = ey * inv, tz[i] = ez * inv;
        inverse[i] = inv;
        tension[i] = length / reference[i];
    }
}

static void pull_elements(int64_t elements, const double *restrict table, int64_t rows,
                          double *restrict tension, const Constants *k) {
    const double area = k->area;
    for (int64_t i = 0; i < elements; i++) {
        double u;
        const int32_t at = place_of(tension[i], rows, k, &u);
        tension[i] = area * (table[at] +
                             u * (table[at + 1] + u * (table[at + 2] + u * table[at + 3])));
    }
}

static void bend_nodes(int64_t elements, const double *restrict tx, const double *restrict ty,
                       const double *restrict tz, const double *restrict reference,
                       double *restrict cosine, double *restrict slope, const Constants *k) {
    const double stiffness = -2.0 * k->bending;
    double sharpest = 0.0;
    for (int64_t i = 1; i < elements; i++) {
        double c = tx[i - 1] * tx[i] + ty[i - 1] * ty[i] + tz[i - 1] * tz[i];
        double u = 1.0 - c;
        sharpest = u > sharpest ? u : sharpest;
        cosine[i] = c;
        slope[i] = stiffness * turning_series(u) / (reference[i - 1] + reference[i]);
    }
    if (sharpest < k->series_limit) return;
    for (int64_t i = 1; i < elements; i++) {
        double u = 1.0 - cosine[i];
        if (u >= k->series_limit)
            slope[i] = stiffness * turning_factor(u, k->series_limit) /
                       (reference[i - 1] + reference[i]);
    }
}

static void along_elements(int64_t elements, const double *restrict inverse,
                           const double *restrict tension, const double *restrict cosine,
                           const double *restrict slope, double *restrict along) {
    for (int64_t i = 0; i < elements; i++)
        along[i] = tension[i] -
                   inverse[i] * (slope[i] * cosine[i] + slope[i + 1] * cosine[i + 1]);
}

static void element_force(int64_t elements, double first, const double *restrict t,
                          const double *restrict inverse, const double *restrict along,
                          const double *restrict slope, double *restrict force) {
    const int64_t end = elements - 1;
    force[0] = along[0] * t[0] + inverse[0] * (slope[0] * first + slope[1] * t[1]);
    for (int64_t i = 1; i < end; i++)
        force[i] = along[i] * t[i] + inverse[i] * (slope[i] * t[i - 1] + slope[i + 1] * t[i + 1]);
    force[end] = along[end] * t[end] + inverse[end] * slope[end] * t[end - 1];
}

static void net_force(int64_t elements, const double *restrict force, double *restrict net) {
    for (int64_t i = 1; i < elements; i++) net[i] = force[i] - force[i - 1];
}

static void touch_cylinder(int64_t end, double dt, double turned, double turning, double landing,
                           int64_t n, const double *restrict x, const double *restrict v,
                           double *restrict slip, double *restrict reach, double *restrict net,
                           int64_t *restrict touching, const Constants *k, double *ledger) {
    const double stick = k->stick_stiffness, per_stick = 1.0 / stick;
    const double dashpot = k->stick_damping / dt, square_landing = landing * landing;
    const double surface = sin(turned);
    double work = 0.0, sliding = 0.0, bouncing = 0.0;
    int64_t edge = end - 1;
    while (edge > 0 && touching[edge] == 0) edge--;
    for (int64_t i = 1; i < end; i++) {
        double px = x[i], py = x[n + i], square = px * px + py * py;
        int held = touching[i] == 1;
        if (!held) {
            if (square >= square_landing) continue;
            touching[i] = 1, reach[i] = landing;
        }
        double radius = sqrt(square), depth = reach[i] - radius;
        double slip_t = slip[i], slip_z = slip[n + i];
        if (depth <= 0.0) {
            sliding += 0.5 * stick * (slip_t * slip_t + slip_z * slip_z);
            touching[i] = 0;
            slip[i] = slip[n + i] = 0.0;
            continue;
        }
        double vx = v[i], vy = v[n + i], inverse = 1.0 / radius;
        double nx = px * inverse, ny = py * inverse, outward = vx * nx + vy * ny;
        double inward = 0.5 * dt * (vx * vx + vy * vy) * inverse - outward;
        double elastic = k->normal_stiffness * depth;
        double normal = elastic + k->normal_damping * inward;
        if (i >= edge) {
            double off = inward + 2.0 * outward + dt / k->mass * (net[i] * nx + net[n + i] * ny);
            normal = fmin(normal, k->mass / dt * (0.25 * depth / dt - off));
        }
        normal = normal > 0.0 ? normal : 0.0;
        int rides = held && (i != edge || turning <= 0.0 || slip_t != 0.0);
        double moved = rides ? (vy * nx - vx * ny) * dt - surface * radius : 0.0;
        double aside = held ? v[2 * n + i] * dt : 0.0;
        slip_t += moved;
        slip_z += aside;
        double ft = -stick * slip_t, fz = -stick * slip_z, size = ft * ft + fz * fz;
        double most = k->friction * normal, way = moved * moved + aside * aside;
        if (size > most * most) {
            sliding += 0.5 * ((size - most * most) * per_stick - stick * way);
            double scale = most / sqrt(size);
            ft *= scale, fz *= scale, slip_t *= scale, slip_z *= scale;
        } else {
            sliding += dashpot * way;
            ft -= dashpot * moved, fz -= dashpot * aside;
        }
        slip[i] = slip_t;
        slip[n + i] = slip_z;
        bouncing += (normal - elastic) * inward;
        work += ft * radius;
        net[i] += normal * nx - ft * ny;
        net[n + i] += normal * ny + ft * nx;
        net[2 * n + i] += fz;
    }
    ledger[SURFACE] += work * turning;
    ledger[FRICTION] += sliding;
    ledger[CONTACT] += bouncing * dt;
}

static double move_nodes(int64_t elements, double dt, double rate, double guide_speed, int64_t n,
                         double *restrict x, double *restrict v, const double *restrict f,
                         const double *restrict t, const int64_t *restrict touching,
                         const Constants *k) {
    double *restrict y = x + n, *restrict z = y + n, *restrict vx = v, *restrict vy = v + n;
    double *restrict vz = vy + n;
    const double *fx = f, *fy = f + n, *fz = fy + n, *tx = t, *ty = t + n;
    const double half = 0.5 * k->damping_rate * dt, decay = (1.0 - half) / (1.0 + half);
    const double push = dt / (k->mass * (1.0 + half)), feed = -0.5 * k->contact_line * rate;
    const double follow = -guide_speed / k->free_length;
    double loss = 0.0;
    for (int64_t i = 1; i < elements; i++) {
        double px = x[i], py = y[i];
        int wound = touching[i] == 1;
        double rx = wound ? -rate * py : feed * (tx[i - 1] + tx[i]);
        double ry = wound ? rate * px : feed * (ty[i - 1] + ty[i]);
        double rz = wound ? 0.0 : follow * py;
        double wx = vx[i] - rx, wy = vy[i] - ry, wz = vz[i] - rz;
        double ux = wx * decay + push * fx[i], uy = wy * decay + push * fy[i];
        double uz = wz * decay + push * fz[i];
        double mx = 0.5 * (ux + wx), my = 0.5 * (uy + wy), mz = 0.5 * (uz + wz);
        loss += mx * (mx + rx) + my * (my + ry) + mz * (mz + rz);
        vx[i] = ux + rx;
        vy[i] = uy + ry;
        vz[i] = uz + rz;
        x[i] = px + dt * vx[i];
        y[i] = py + dt * vy[i];
        z[i] += dt * vz[i];
    }
    return k->mass * k->damping_rate * dt * loss;
}

/* Advance by equal steps while the drive (7, 2) runs from its first to its second column. */
void advance(State *s, int64_t steps, double dt, const double *drive, const Arrays *a,
             const Constants *k, double *ledger) {
    const int64_t n = a->capacity;
    double *x = a->position, *v = a->velocity, *t = a->tangent;
    double *force = a->force, *net = a->net;
    const double span = (double)steps * dt;
    double first[3] = {0.0, 0.0, 0.0}, angle = drive[2 * ANGLE];
    s->status = RUNNING;
    for (int64_t step = 0; step < steps; step++) {
        s->status = s->nodes == n ? FULL : RUNNING;
        if (s->status == FULL) return;
        double u = (double)step / (double)steps, share = ((double)step + 1.0) / (double)steps;
        double pull = drive[2 * TENSION] + u * (drive[2 * TENSION + 1] - drive[2 * TENSION]);
        double pulled = drive[2 * STRETCH] + u * (drive[2 * STRETCH + 1] - drive[2 * STRETCH]);
        double landing = drive[2 * LANDING] + u * (drive[2 * LANDING + 1] - drive[2 * LANDING]);
        double next_angle = hermite(drive[2 * ANGLE], drive[2 * ANGLE + 1], drive[2 * SPEED] * span,
                                    drive[2 * SPEED + 1] * span, share);
        double next_guide = hermite(drive[2 * GUIDE], drive[2 * GUIDE + 1], drive[2 * FEED] * span,
                                    drive[2 * FEED + 1] * span, share);
        double rotation = next_angle - angle, rate = rotation / dt;
        int64_t elements = s->nodes - 1, end = elements - 1;

        stretch_elements(elements, x, x + n, x + 2 * n, a->reference, t, t + n, t + 2 * n,
                         a->inverse, a->tension);
        pull_elements(elements, a->table, a->table_rows, a->tension, k);
        a->tension[end] = pull;
        bend_nodes(elements, t, t + n, t + 2 * n, a->reference, a->cosine, a->slope, k);
        first[0] = sin(angle);
        first[1] = -cos(angle);
        a->cosine[0] = first[0] * t[0] + first[1] * t[n];
        a->slope[0] = -2.0 * k->bending * turning_factor(1.0 - a->cosine[0], k->series_limit) /
                      a->reference[0];
        a->cosine[elements] = a->slope[elements] = 0.0;
        along_elements(elements, a->inverse, a->tension, a->cosine, a->slope, a->along);
        for (int c = 0; c < 3; c++) {
            element_force(elements, first[c], t + c * n, a->inverse, a->along, a->slope,
                          force + c * n);
            net_force(elements, force + c * n, net + c * n);
        }
        touch_cylinder(elements, dt, s->surface_step, rotation, landing, n, x, v, a->slip,
                       a->contact_radius, net, a->touching, k, ledger);
        double guide_speed = (next_guide - x[2 * n + elements]) / dt;
        ledger[DAMPING] +=
            move_nodes(elements, dt, rate, guide_speed, n, x, v, net, t, a->touching, k);
        ledger[SPAN] += dt * (force[end] * v[end] + force[n + end] * v[n + end] +
                              force[2 * n + end] * v[2 * n + end]);

        angle = next_angle;
        double tie_x = k->start_radius * cos(angle), tie_y = k->start_radius * sin(angle);
        double moment = a->slope[0] * (first[0] * t[n] - first[1] * t[0]);
        ledger[TIE] += -force[0] * (tie_x - x[0]) - force[n] * (tie_y - x[n]) + moment * rotation;
        x[0] = tie_x, x[n] = tie_y, x[2 * n] = 0.0;
        v[0] = -rate * tie_y, v[n] = rate * tie_x, v[2 * n] = 0.0;
        x[2 * n + elements] = next_guide;
        v[2 * n + elements] = guide_speed;
        s->surface_step = rotation;

        double square = 0.0;
        for (int c = 0; c < 3; c++) {
            double edge = x[c * n + elements] - x[c * n + end];
            square += edge * edge;
        }
        double last = sqrt(square) / pulled;
        s->taken = step + 1;
        if (!(last > 0.0 && last < 1.0e3 * k->segment)) {
            s->status = DIVERGED;
            return;
        }
        if (last > k->cut_at * k->segment) {
            int64_t nodes = s->nodes;
            double part = k->segment / last;
            for (int c = 0; c < 3; c++) {
                double *p = x + c * n, *w = v + c * n;
                p[nodes] = p[elements];
                w[nodes] = w[elements];
                p[elements] = p[end] + part * (p[nodes] - p[end]);
                w[elements] = w[end];
            }
            a->touching[elements] = a->touching[nodes] = 0;
            a->slip[elements] = a->slip[n + elements] = 0.0;
            a->contact_radius[elements] = 0.0;
            a->reference[end] = k->segment;
            a->reference[elements] = last - k->segment;
            ledger[INFLOW] += inflow(a, k, end, elements);
            s->nodes++;
        } else if (last < k->merge_at * k->segment) {
            if (s->nodes < 4) {
                s->status = EMPTY;
                return;
            }
            ledger[INFLOW] -= inflow(a, k, end - 1, end);
            for (int c = 0; c < 3; c++) {
                x[c * n + end] = x[c * n + elements];
                v[c * n + end] = v[c * n + elements];
            }
            a->reference[end - 1] = k->segment + last;
            a->touching[end] = 0;
            s->nodes--;
        } else {
            a->reference[end] = last;
        }
    }
}
