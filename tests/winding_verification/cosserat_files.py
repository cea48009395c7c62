"""Experiments in the format of cosseratbench, made here: nothing of that benchmark is kept."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

GRAVITY = 9.81


def rod(line: np.ndarray, radius: float, young: float, **more: Any) -> dict[str, Any]:
    return {
        "centerline": line.tolist(),
        "radius": radius,
        "material": {"youngs_modulus": young, "shear_modulus": young / 3.0, "density": 1000.0},
        "normal": [0.0, 1.0, 0.0],
        "start": "free",
        "end": "free",
        "loads": [],
        "rest_arc_length": None,
        "start_motion": None,
        "end_motion": None,
        **more,
    }


def write(
    folder: Path, name: str, values: dict[str, float], rods: list[dict[str, Any]], **scenario: Any
) -> Path:
    file = folder / name / ",".join(f"{k}={v:g}" for k, v in values.items()) / "experiment.json"
    file.parent.mkdir(parents=True)
    content = {"rods": rods, "gravity": [0.0, 0.0, 0.0], "quasi_static": True, **scenario}
    file.write_text(json.dumps({"name": name, "values": values, "scenario": content}))
    return file


def cantilever(folder: Path) -> Path:
    line = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    load = [{"force": [0.0, 0.0, -7.5e-3], "at": "end"}]
    one = rod(line, 0.02, 1.0e6, start="clamped", loads=load, normal=[0.0, 0.0, 1.0])
    return write(folder, "cantilever", {}, [one], duration=10.0)


def catenary(folder: Path, span: float = 0.8) -> Path:
    # A circular arc of length one hangs below the supports: not the answer.
    low, high = 1.0e-6, math.pi
    while high - low > 1.0e-14:
        half = 0.5 * (low + high)
        low, high = (half, high) if math.sin(half) / half > span else (low, half)
    at = np.linspace(-half, half, 401)
    across = 0.5 / half
    line = np.stack(
        [0.5 * span + across * np.sin(at), 0.0 * at, across * (math.cos(half) - np.cos(at))], axis=1
    )
    one = rod(line, 0.005, 1.0e6, start="pinned", end="pinned")
    gravity = [0.0, 0.0, -GRAVITY]
    return write(folder, "catenary", {"span": span}, [one], gravity=gravity, duration=5.0)


def pendulum(folder: Path, young: float = 1.0e7) -> Path:
    # Near enough to the first swing: a hanging chain's, J0 of the root of the height.
    s = np.linspace(0.0, 1.0, 201)
    from scipy.special import j0, jn_zeros

    x = 0.02 * j0(float(jn_zeros(0, 1)[0]) * np.sqrt(1.0 - s))
    strain = 1000.0 * GRAVITY * (1.0 - s) / young
    slope = np.gradient(x, s)
    drop = np.sqrt((1.0 + strain) ** 2 - slope**2)
    z = -np.concatenate([[0.0], np.cumsum(0.5 * (drop[1:] + drop[:-1]) * np.diff(s))])
    one = rod(
        np.stack([x, 0.0 * s, z], axis=1), 0.002, young,
        start="pinned", rest_arc_length=s.tolist(),
    )  # fmt: skip
    gravity = [0.0, 0.0, -GRAVITY]
    return write(
        folder, "pendulum", {"youngs_modulus": young}, [one],
        gravity=gravity, duration=5.0, quasi_static=False,
    )  # fmt: skip


def twist(folder: Path, tension: float, critical: float, levels: list[float]) -> Path:
    """Write rods that are turned by shares of a twist [rad] and held."""
    young, radius = 1.0e6, 0.01
    bending = young * math.pi * radius**4 / 4.0
    s = np.linspace(0.0, 1.0, 201)
    times = np.linspace(0.0, 6.0, 121)
    rods = []
    for i, level in enumerate(levels):
        bump = 0.5e-4 * (1.0 - np.cos(2.0 * math.pi * s))
        turned = level * critical * 0.5 * (1.0 - np.cos(math.pi * times / 6.0))
        motion = {
            "times": times.tolist(),
            "displacement": np.zeros((times.size, 3)).tolist(),
            "rotation": np.stack([turned, 0.0 * times, 0.0 * times], axis=1).tolist(),
            "slides_along": [1.0, 0.0, 0.0],
        }
        rods.append(
            rod(
                np.stack([s, 0.25 * i + bump, 0.0 * s], axis=1), radius, young,
                start="clamped", end="clamped", end_motion=motion, normal=[0.0, 0.0, 1.0],
                loads=[{"force": [tension * bending, 0.0, 0.0], "at": "end"}],
            )
        )  # fmt: skip
    return write(folder, "twist", {"tension": tension}, rods, duration=16.0)


def holding(friction: float, short: float = 0.15, wrap: float = 0.051) -> float:
    """Return the longest heavy side [m] that a heavy rope over half a turn holds."""
    ratio = math.exp(friction * math.pi)
    return ratio * short + wrap * 2.0 * friction / (1.0 + friction**2) * (ratio + 1.0)


def capstan(folder: Path, overhang: float = 0.8, friction: float = 0.3) -> Path:
    young, radius, short, wrap = 3.0e5, 0.001, 0.15, 0.051
    long = overhang * holding(friction)
    area = math.pi * radius**2
    weight = 1000.0 * area * GRAVITY
    phi = np.linspace(0.0, math.pi, 400)

    def tension(m: float) -> np.ndarray:
        # dT/dphi = m T + w R (cos phi + m sin phi) from the light side on.
        t = np.zeros_like(phi)
        t[0] = weight * short
        for i, step in enumerate(np.diff(phi)):
            mid = phi[i] + 0.5 * step
            push = weight * wrap * (math.cos(mid) + m * math.sin(mid))
            half = t[i] + 0.5 * step * (
                m * t[i] + weight * wrap * (math.cos(phi[i]) + m * math.sin(phi[i]))
            )
            t[i + 1] = t[i] + step * (m * half + push)
        return t

    low, high = -friction, friction
    for _ in range(60):
        m = 0.5 * (low + high)
        low, high = (m, high) if tension(m)[-1] < weight * long else (low, m)
    # Sagging sides below, the wrap on the cylinder, all as they hang stretched.
    light, heavy = np.linspace(0.0, short, 120), np.linspace(0.0, long, 400)
    stretch = weight / (young * area)
    down = light + 0.5 * stretch * light**2
    fall = heavy + stretch * (long * heavy - 0.5 * heavy**2)
    nil = np.zeros
    points = np.concatenate(
        [
            np.stack([nil(120) - wrap, nil(120), down - down[-1]], axis=1),
            np.stack([-wrap * np.cos(phi), nil(400), wrap * np.sin(phi)], axis=1)[1:],
            np.stack([nil(400) + wrap, nil(400), -fall], axis=1)[1:],
        ]
    )
    pull = np.concatenate([weight * light, tension(m)[1:], (weight * (long - heavy))[1:]])
    gaps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    rest = gaps / (1.0 + 0.5 * (pull[1:] + pull[:-1]) / (young * area))
    arc = np.concatenate([[0.0], np.cumsum(rest)]).tolist()
    one = rod(points, radius, young, rest_arc_length=arc)
    cylinder = {
        "center": [0.0, 0.0, 0.0], "axis": [0.0, 1.0, 0.0],
        "radius": 0.05, "length": 0.1, "friction": friction,
    }  # fmt: skip
    return write(
        folder, "capstan", {"overhang": overhang, "friction": friction}, [one],
        gravity=[0.0, 0.0, -GRAVITY], obstacles=[cylinder], duration=2.0,
    )  # fmt: skip
