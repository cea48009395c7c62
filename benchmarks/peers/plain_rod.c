/* Winds a whole run with the plainest explicit rod in C: every turn integrated, no ledger.
 * Arguments (SI): duration, omega, ramp time, feed per radian, EA, EI, mass of a node, element length, tension,
 * friction, free length, contact line, landing radius, normal stiffness, damping rate, step, spacing, markers.
 * Prints its processor time [s] and theta, z of every marker. Node 0 is P0, the last one the guide's eye. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#define N 8192
static double x[3][N], v[3][N], t[3][N], f[3][N], ref[N], inv[N], pull[N], c[N], s[N], slip[2][N];
int main(int argc, char **argv) {
    double p[18], angle = 0.0, guide = 0.0;
    for (int i = 0; i < 18; i++) p[i] = atof(argv[argc > i + 1 ? i + 1 : 0]);
    const double omega = p[1], ramp = p[2], feed = p[3], EA = p[4], EI = p[5], m = p[6], h = p[7], F = p[8], mu = p[9];
    const double L = p[10], line = p[11], reach = p[12], kn = p[13], ks = 0.25 * kn, rate = p[14], dt = p[15];
    const double stretch = 1.0 + F / EA, cn = 0.4 * sqrt(kn * m), cs = 0.2 * sqrt(ks * m), half = 0.5 * rate * dt;
    int last = (int)(L / (stretch * h) + 0.5);
    for (int i = 0; i <= last; i++) x[0][i] = i ? line : reach, x[1][i] = i == last ? -L : -i * h * stretch;
    for (int i = 0; i < last; i++) ref[i] = (x[1][i] - x[1][i + 1]) / stretch;
    clock_t begin = clock();
    for (long step = 1; step <= (long)(p[0] / dt + 0.5); step++) {
        double now = step * dt, turned = omega * (now < ramp ? 0.5 * now * now / ramp : now - 0.5 * ramp) - angle;
        double w = turned / dt;
        for (int i = 0; i < last; i++) {
            double a = x[0][i + 1] - x[0][i], b = x[1][i + 1] - x[1][i], d = x[2][i + 1] - x[2][i];
            double l = sqrt(a * a + b * b + d * d);
            inv[i] = 1.0 / l, t[0][i] = a * inv[i], t[1][i] = b * inv[i], t[2][i] = d * inv[i];
            pull[i] = i == last - 1 ? F : EA * (l / ref[i] - 1.0);
        }
        for (int i = 1; i < last; i++) {
            c[i] = t[0][i - 1] * t[0][i] + t[1][i - 1] * t[1][i] + t[2][i - 1] * t[2][i];
            double u = 1.0 - c[i], over_sine = 1.0 + u * (1.0 / 3.0 + u * (2.0 / 15.0 + u * 2.0 / 35.0));
            s[i] = -2.0 * EI * over_sine / (ref[i - 1] + ref[i]);
        }
        for (int i = 0; i < last; i++)
            for (int k = 0; k < 3; k++)
                f[k][i] = (pull[i] - inv[i] * (s[i] * c[i] + s[i + 1] * c[i + 1])) * t[k][i] +
                          inv[i] * (s[i] * (i ? t[k][i - 1] : 0.0) + s[i + 1] * (i + 1 < last ? t[k][i + 1] : 0.0));
        for (int i = 1; i < last; i++) {
            double g[3], meant[3] = {0.0, line * w, 0.0}, r2 = x[0][i] * x[0][i] + x[1][i] * x[1][i];
            for (int k = 0; k < 3; k++) g[k] = f[k][i] - f[k][i - 1];
            if (r2 < reach * reach) {
                double r = sqrt(r2), nx = x[0][i] / r, ny = x[1][i] / r;
                double push = kn * (reach - r) - cn * (v[0][i] * nx + v[1][i] * ny);
                double along = (v[1][i] * nx - v[0][i] * ny) * dt - turned * r, aside = v[2][i] * dt;
                if (x[0][i + 1] * x[0][i + 1] + x[1][i + 1] * x[1][i + 1] >= reach * reach) {
                    double off = v[0][i] * nx + v[1][i] * ny + dt / m * (g[0] * nx + g[1] * ny);
                    push = fmin(push, m / dt * (0.25 * (reach - r) / dt - off));
                    along = slip[0][i] == 0.0 ? 0.0 : along;
                }
                push = push > 0.0 ? push : 0.0, slip[0][i] += along, slip[1][i] += aside;
                double ft = -ks * slip[0][i], fz = -ks * slip[1][i], size = sqrt(ft * ft + fz * fz), most = mu * push;
                double cut = size > most ? most / size : 1.0;
                ft *= cut, fz *= cut, slip[0][i] *= cut, slip[1][i] *= cut;
                if (cut == 1.0) ft -= cs * along / dt, fz -= cs * aside / dt;
                g[0] += push * nx - ft * ny, g[1] += push * ny + ft * nx, g[2] += fz;
                meant[0] = -w * x[1][i], meant[1] = w * x[0][i];
            } else slip[0][i] = slip[1][i] = 0.0;
            for (int k = 0; k < 3; k++)
                v[k][i] = meant[k] + ((v[k][i] - meant[k]) * (1.0 - half) + dt * g[k] / m) / (1.0 + half);
        }
        for (int k = 0; k < 3; k++) for (int i = 1; i < last; i++) x[k][i] += dt * v[k][i];
        angle += turned, guide = feed * angle, x[0][0] = reach * cos(angle), x[1][0] = reach * sin(angle);
        x[2][last] = guide;
        double l = 0.0;
        for (int k = 0; k < 3; k++) l += pow(x[k][last] - x[k][last - 1], 2);
        ref[last - 1] = sqrt(l) / stretch;
        if (ref[last - 1] > 1.6 * h) {
            double part = h / ref[last - 1];
            for (int k = 0; k < 3; k++) {
                x[k][last + 1] = x[k][last], v[k][last] = v[k][last - 1];
                x[k][last] = x[k][last - 1] + part * (x[k][last + 1] - x[k][last - 1]);
            }
            ref[last] = ref[last - 1] - h, ref[last - 1] = h, c[last] = s[last] = 0.0, last++;
        }
    }
    printf("%.9g", (double)(clock() - begin) / CLOCKS_PER_SEC);
    double arc = 0.0, theta = 0.0;
    for (int i = 0, n = 1; i < last && n <= (int)p[17]; i++) {
        double a = x[0][i] * x[1][i + 1] - x[1][i] * x[0][i + 1], b = x[0][i] * x[0][i + 1] + x[1][i] * x[1][i + 1];
        for (; n <= (int)p[17] && n * p[16] <= arc + ref[i]; n++) {
            double u = (n * p[16] - arc) / ref[i];
            printf(" %.9g %.9g", theta + u * -atan2(a, b), x[2][i] + u * (x[2][i + 1] - x[2][i]));
        }
        arc += ref[i], theta -= atan2(a, b);
    }
    printf("\n");
    return 0;
}
