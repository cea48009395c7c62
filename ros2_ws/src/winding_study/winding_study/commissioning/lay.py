"""Where markers lie on many cells at once: tension, friction, law and lag in closed form.

Cable lands with the span's tension F less EI l / (2 rho^2) for bending and follows the fleet-angle
law with the lag L cos(phi) / rho, cos(phi) = 1 - EI l / (2 F rho^2). Friction then holds any
tension whose logarithm changes along the cable by no more than mu a radian (capstan law): a span
that pulls harder draws laid cable on, one that pulls less lets it come back. What elements and
contact add is found by the rod, see `posterior`.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from cable_fem_node.identification.quasi_static import landed_z, turning, unit_law
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.run_ahead import replay
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.markers import is_wound
from winding_core.run_inputs import Inputs, continued_inputs
from winding_study.commissioning.motion import Motion
from winding_study.commissioning.unknowns import Array, Numbers

# Between two places of the grid [rad]: against half of it no angle moved by 0.3 mrad.
_STEP = 0.2
# The motion goes on so far over its end.
_BEYOND = 1.08
# The pull is averaged over so much to either side [rad]: a load cell is noisy.
_AVERAGED = 0.3
# Slip reaches no further back than this [rad]: at a friction of 0.06 that is a ratio of 6.
_SLIP_REACH = 30.0
# Shares of C01 between which the law is interpolated.
_SHARES = np.linspace(0.0, 0.9, 10)
_STRESSES = np.linspace(0.0, 2.5, 1200)
# An element lies on the cylinder at most so many times its length long, as in `rod_run`.
_LONGEST = 1.15
# Where bending takes more than this, no cable lies on the cylinder.
_MOST_BENT = 0.9


@dataclass(frozen=True, kw_only=True)
class Places:
    """Where markers lie: nan for one that has not landed."""

    theta: Array  # Wound angles [rad], shape (n, m)
    z: Array  # [m], shape (n, m)


class CellLay:
    """The closed form of one motion of the machine.

    Args:
        config: What is wound, as far as it is known.
        inputs: The machine's motion, with the pull at the guide as its tension.
        motion: That was commanded. The brake's own friction follows the turns of its pull: those of
            a load cell's noise would draw it along.
    """

    def __init__(self, config: WindingConfig, inputs: Inputs, motion: Motion) -> None:
        case = config.case
        self.config = config
        self.arc = case.marker_spacing * np.arange(1, case.marker_count + 1)
        self.end = float(inputs["cylinder_angle"].max())
        # What lands late on one cell has landed on another.
        reach = _BEYOND * self.end
        self.inputs = continued_inputs(inputs, reach)
        forward, span = turning(self.inputs, config)
        self._theta = np.linspace(0.0, reach, max(8, math.ceil(reach / _STEP)) + 1)
        self._guide = np.interp(
            self._theta, forward["cylinder_angle"], forward["carriage_position"]
        )
        longer = span - config.free_length
        self._longer = np.interp(self._theta, forward["cylinder_angle"], longer)
        self.advance = float(self._guide[-1] - self._guide[0]) / reach  # [m/rad]
        self.pull = _averaged(self._theta, forward["cylinder_angle"], forward["tension"])
        self._commanded = motion.pull_at(self._theta)
        self._bend = 0.5 * case.bending_stiffness / (case.material.young * case.axial_area)
        self._laws = _law_table(config)

    @property
    def mean_pull(self) -> float:
        """Mean pull at the guide [N]."""
        return float(self.pull.mean())

    @property
    def wound(self) -> float:
        """Length of the cylinder's surface that is wound [m]."""
        return self.config.case.centreline_radius * self.end

    def __call__(self, numbers: Numbers) -> Places:
        """Return where all markers lie on each cell."""
        theta, step = self._theta, float(self._theta[1])
        case = self.config.case
        tables = self._laws.rows(numbers["law_share"])
        stiffness = (numbers["young"] * case.axial_area)[:, None]
        span = self._span(numbers) / stiffness
        radius = case.cylinder_radius + case.cable_radius * tables.lateral(span)
        bent = self._bend * tables.stretch(span) / radius**2
        cosine = 1.0 - np.minimum(bent / np.maximum(span, 1.0e-9), _MOST_BENT)
        held = _held(span, numbers["friction"], step)
        stretch = tables.stretch(held - bent)
        radius = case.cylinder_radius + case.cable_radius * tables.lateral(held)
        lag = (numbers["free_length"][:, None] + self._longer) * cosine / radius
        z = landed_z(lag, self._guide + numbers["eye"][:, None] * (theta > 0.0), step)
        slope = np.gradient(z, step, axis=1)
        density = np.hypot(radius, slope) / stretch
        laid = np.zeros_like(density)
        np.cumsum(0.5 * step * (density[:, 1:] + density[:, :-1]), axis=1, out=laid[:, 1:])
        places = np.full((2, laid.shape[0], self.arc.size), math.nan)
        for row in range(laid.shape[0]):
            landed = np.interp(self.arc, laid[row], theta, right=math.nan)
            places[0, row] = landed
            places[1, row] = np.interp(landed, theta, z[row], right=math.nan)
        scale = 1.0 + numbers["camera_scale"][:, None]
        return Places(theta=places[0], z=places[1] * scale)

    def slips(self, numbers: Numbers) -> list[tuple[float, float]]:
        """Return where the tension of one cell changes faster than friction holds.

        Returns:
            Wound angle behind each such change [rad], and change of the stretch over it.
        """
        span = self._span(numbers)
        stretch = self._laws.rows(numbers["law_share"]).stretch(
            span / (numbers["young"] * self.config.case.axial_area)[:, None]
        )[0]
        rate = np.abs(np.diff(np.log(span[0]))) / self._theta[1]
        slipping = np.concatenate([[False], rate > float(numbers["friction"][0]), [False]])
        edges = np.flatnonzero(np.diff(slipping))
        return [
            (float(self._theta[end]), float(abs(stretch[end] - stretch[begin])))
            for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
        ]

    @property
    def element(self) -> float:
        """Angle that an element of the rod lies on [rad], before it is stretched."""
        return self.config.resolved.segment / self.config.case.centreline_radius

    def rod(self, numbers: Numbers) -> Places:
        """Return where the rod has the markers of one cell, whose numbers have shape (1,).

        Eye and camera are those of a cell without errors.

        Raises:
            SolverError, ValueError: The rod fails, or the material cannot carry the tension.
        """
        model = RodWinding(self.rod_config(numbers))
        replay(self.rod_inputs(numbers), model)
        markers = model.markers()[1:]
        landed = is_wound(markers)
        theta, z = (np.where(landed, markers[name], math.nan) for name in ("theta", "z"))
        return Places(theta=theta[None], z=z[None])

    def rod_config(self, numbers: Numbers) -> WindingConfig:
        """Return what the rod winds of one cell."""
        share = float(numbers["law_share"][0])
        material = dataclasses.replace(self.config.case.material, young=float(numbers["young"][0]))
        law = "mooney_rivlin" if share > 0.0 else self.config.law
        stress = self._span(numbers) / (float(numbers["young"][0]) * self.config.case.axial_area)
        longest = float(self._laws.rows(numbers["law_share"]).stretch(stress).max())
        return dataclasses.replace(
            self.config,
            case=dataclasses.replace(self.config.case, material=material),
            law=law,
            mooney_ratio=share / (1.0 - share) if share > 0.0 else self.config.mooney_ratio,
            friction=float(numbers["friction"][0]),
            free_length=float(numbers["free_length"][0]),
            segment_length=self.config.resolved.segment * min(1.0, _LONGEST / longest),
        )

    def rod_inputs(self, numbers: Numbers) -> Inputs:
        """Return the motion with the tension at the cylinder of one cell."""
        inputs = self.inputs.copy()
        inputs["tension"] = np.interp(inputs["cylinder_angle"], self._theta, self._span(numbers)[0])
        return inputs

    def _span(self, numbers: Numbers) -> Array:
        """Return the tension at the cylinder [N], shape (n, k)."""
        pull = np.broadcast_to(self.pull, (numbers["young"].size, self.pull.size))
        if np.ptp(self._commanded) > 0.0:
            pull = pull * _behind(self._commanded, numbers["brake_friction"])
        wound = self.config.case.centreline_radius * self._theta
        built = 1.0 - (1.0 - numbers["start_share"][:, None]) * np.exp(
            -wound / numbers["build_up_length"][:, None]
        )
        full = numbers["load_share"][:, None] * pull + numbers["guide_drag"][:, None]
        return np.asarray(full * built)


def _averaged(theta: Array, angle: Array, values: Array) -> Array:
    """Return means of values about each wound angle, shape of theta."""
    area = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(angle))])
    low = np.clip(theta - _AVERAGED, angle[0], angle[-1])
    high = np.clip(theta + _AVERAGED, angle[0], angle[-1])
    return np.asarray((np.interp(high, angle, area) - np.interp(low, angle, area)) / (high - low))


def _behind(pull: Array, friction: Array) -> Array:
    """Return the tension behind a brake with friction over the pull, shape (n, k).

    Args:
        pull: Commanded [N], shape (k,).
        friction: Share of the pull that is held back, shape (n,).
    """
    found = np.empty((friction.size, pull.size))
    held = np.full(friction.size, pull[0])
    for k, now in enumerate(pull.tolist()):
        held = np.clip(held, (1.0 - friction) * now, (1.0 + friction) * now)
        found[:, k] = held / now
    return found


def _held(span: Array, friction: Array, step: float) -> Array:
    """Return what stays on the cylinder of a span's tension, shape (n, k)."""
    held = span.copy()
    reach = min(span.shape[1], math.ceil(_SLIP_REACH / step))
    grown = np.exp(friction[:, None] * step * np.arange(reach)[::-1])
    changing = np.abs(np.diff(np.log(np.maximum(span, 1.0e-12)), axis=1))
    slips = np.flatnonzero((changing > 0.999 * friction[:, None] * step).any(axis=0)) + 1
    for k in slips.tolist():
        first = max(0, k + 1 - reach)
        ratio = grown[:, reach - (k + 1 - first) :]
        now = span[:, k : k + 1]
        np.clip(held[:, first : k + 1], now / ratio, now * ratio, out=held[:, first : k + 1])
    return held


@dataclass(frozen=True, kw_only=True)
class _Laws:
    """Stretch and lateral stretch over stress / E, at shares of C01; shapes (s, p)."""

    axial: Array
    side: Array

    def rows(self, share: Array) -> _Laws:
        """Return the tables of each row's share, shapes (n, p)."""
        if self.axial.shape[0] == 1:
            picked = np.zeros(share.size, dtype=int)
            return _Laws(axial=self.axial[picked], side=self.side[picked])
        place = np.clip(share / _SHARES[1], 0.0, _SHARES.size - 1.001)
        low = place.astype(int)
        part = (place - low)[:, None]
        return _Laws(
            **{
                name: (1.0 - part) * table[low] + part * table[low + 1]
                for name, table in (("axial", self.axial), ("side", self.side))
            }
        )

    def stretch(self, stress: Array) -> Array:
        """Return stretches at stresses over E, shape (n, k) each."""
        return _interpolated(stress, self.axial)

    def lateral(self, stress: Array) -> Array:
        """Return lateral stretches at stresses over E, shape (n, k) each."""
        return _interpolated(stress, self.side)


def _interpolated(stress: Array, tables: Array) -> Array:
    return np.array(
        [np.interp(row, _STRESSES, table) for row, table in zip(stress, tables, strict=True)]
    )


def _law_table(config: WindingConfig) -> _Laws:
    shares = _SHARES if config.law in ("neo_hookean", "mooney_rivlin") else np.zeros(1)
    axial, side = [], []
    for share in shares.tolist():
        law = config.resolved.law
        if shares.size > 1:
            law = dataclasses.replace(law, law="mooney_rivlin", mooney_ratio=share / (1.0 - share))
        stretch, stress, lateral = unit_law(law)
        axial.append(np.interp(_STRESSES, stress, stretch))
        side.append(
            np.interp(_STRESSES, stress, lateral if config.thins else np.ones_like(lateral))
        )
    return _Laws(axial=np.array(axial), side=np.array(side))
