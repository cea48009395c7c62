"""Closed-form lay of many rigs at once, with what bending and friction do at the landing.

Beyond `quasi_static.lay` a cable with bending stiffness touches the cylinder phi = arccos(1 - b)
late, with b = EI l / (2 F rho^2), so that it lands under the tension of a little later and with the
lag L cos(phi) / rho; friction holds any tension whose logarithm changes along the cable by no more
than mu a radian (capstan law): a span that pulls harder draws laid cable on, one that pulls less
lets it come back; and the rod's elements and contact add what `landing` finds.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.identification.landing import SHORT_ELEMENTS, Landing, landing_of
from cable_fem_node.identification.quasi_static import landed_z, turning, unit_law
from cable_fem_node.identification.rig import MOONEY, Numbers, unknowns_of
from cable_fem_node.identification.tracked_run import (
    IdentificationError,
    Readings,
    TrackedRun,
    span_tensions,
)
from cable_fem_node.winding.resolved_model import STIFF
from cable_fem_node.winding.rig_prior import KNOWN_TENSION
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.machine.drive import DriveProfile
from winding_core.run_inputs import Inputs, continued_inputs

_MOST_BENT = 0.9  # Where bending would take more than this, no cable lies on the cylinder any more
# Between two places of the grid [rad]: against 0.01 no angle of 150 rigs moved by 0.15 mrad.
_STEP = 0.2
_CORNER_STEP = 0.1  # The same along a commanded pull, whose corners are a search's kinks
_AT_ONCE = 400_000  # Places of all rigs that are held at once; beyond, rigs come in turn
_LONGEST = 4.0  # No cable of this model is longer than this many times its length
_AVERAGED = 0.3  # The pull is averaged over so much to either side [rad]: a load cell is noisy
# Slip reaches no further back than this [rad]: at a friction of 0.06 that is a ratio of 6.
_SLIP_REACH = 30.0
# Shares of C01 between which the stress at a stretch is interpolated: it goes straight with the
# share, the stretch at a stress does not.
_SHARES = tuple(0.05 * k for k in range(19))
# A motion goes on so far over its end: what lands late on one rig has landed on another.
BEYOND = 1.08


class RigLay:
    """Where the markers of one motion would lie, rig by rig.

    Args:
        config: What is wound, as far as it is known.
        inputs: The machine's motion; their tension is what the rig's share and drag are of.
        readings: Where markers were seen; None: the limit of short elements is asked for.
        commanded: Pull that was commanded [N] at cylinder angles [rad], see `TrackedRun`. The
            brake's own friction follows its turns: those of a load cell's noise would draw it.

    Raises:
        IdentificationError: The cylinder does not turn far enough for the run's markers.
    """

    def __init__(
        self,
        config: WindingConfig,
        inputs: Inputs,
        readings: Readings | None = None,
        commanded: Callable[[FloatArray], FloatArray] | None = None,
    ) -> None:
        case = config.case
        self.config = config
        self.end = float(inputs["cylinder_angle"].max())
        count = case.marker_count
        if readings is None:
            count = min(count, int(self.end * case.centreline_radius / case.marker_spacing))
        self.arc = np.asarray(case.marker_spacing * np.arange(1, count + 1), dtype=float)
        reach = _LONGEST * case.marker_spacing * count / case.cylinder_radius + 2.0
        self.inputs = continued_inputs(inputs, max(reach, BEYOND * self.end))
        forward, span = turning(self.inputs, config)
        # Beyond the free length of a guide that keeps its place.
        self._longer = span - config.free_length
        self._angle = forward["cylinder_angle"]
        if readings is not None and self._angle[-1] < readings.theta[-1]:
            raise IdentificationError(
                f"P{readings.ids[-1]} does not land within the run: it was measured at "
                f"{readings.theta[-1]:.4g} rad, the cylinder turns by {self._angle[-1]:.4g} rad"
            )
        self._guide = forward["carriage_position"]
        self._pull = _averaged(self._angle, span_tensions(config, forward))
        self._commanded = commanded
        self._area = case.axial_area
        self._stretch, self._stress, lateral = unit_law(config.resolved.law)
        sides = lateral if config.resolved.thins else np.ones_like(lateral)
        self._radius = case.cylinder_radius + case.cable_radius * sides
        # EI / (2 EA): bending's share of a stress over E.
        self._bend = 0.5 * case.bending_stiffness / (case.material.young * case.axial_area)
        known = (item for item in unknowns_of(KNOWN_TENSION, config) if item.known)
        self._configured = {item.name: item.value(np.zeros(1)) for item in known}
        self._about = None if readings is None else self._span_stretch(readings)
        self._drive = _drive_of(inputs)
        self._landings: dict[bool, Landing] = {}

    @classmethod
    def of(cls, run: TrackedRun) -> RigLay:
        """Return the closed form of a tracked run."""
        return cls(run.config, run.inputs, run.readings, run.commanded)

    def _span_stretch(self, readings: Readings) -> float:
        """Return about the stretch of the span, from the last marker."""
        radius = self.config.case.centreline_radius
        length = np.hypot(radius * readings.theta[-1], readings.z[-1])
        wound = max(float(length) / self.arc[readings.ids[-1] - 1], 1.0)
        bent = self._bend * wound / radius**2
        return float(np.interp(self.stress_of(wound) + bent, self._stress, self._stretch))

    def mean_pull(self, angle: float) -> float:
        """Return the mean stated tension [N] until the cylinder has turned by an angle [rad]."""
        return float(self._pull[: max(1, np.searchsorted(self._angle, angle))].mean())

    def stress_of(self, stretch: float) -> float:
        """Return the nominal stress over E under a stretch, with the law as configured."""
        return float(np.interp(stretch, self._stretch, self._stress))

    def added_stretch(self) -> float:
        """Return what elements and contact of the rod add to the stretch of the run, relative."""
        if self._about is None:
            return 0.0
        known = self._landing(self.config.resolved.constants.late > 0)
        stress = np.array([self.stress_of(self._about)])
        span = np.interp(stress, self._stress, self._stretch)
        more = stress * (1.0 + known.at(span).excess)
        return abs(float(np.interp(more, self._stress, self._stretch)[0]) / self._about - 1.0)

    @property
    def element(self) -> float:
        """Angle that an element of the rod lies on [rad], before it is stretched."""
        return self.config.resolved.segment / self.config.case.centreline_radius

    def slips(self, numbers: Numbers) -> list[tuple[float, float]]:
        """Return where the commanded tension of one rig changes faster than friction holds.

        Args:
            numbers: Shape (1,) each.

        Returns:
            Wound angle behind each such change [rad], and change of the stretch over it.
        """
        if self._commanded is None:
            return []
        numbers = self._configured | numbers
        theta = np.linspace(0.0, self.end, math.ceil(self.end / _STEP) + 1)
        span = self.stress(numbers, theta)[0]
        stretch = self._at(span[None], numbers["law_share"])[0]
        rate = np.abs(np.diff(np.log(span))) / theta[1]
        slipping = np.concatenate([[False], rate > float(numbers["friction"][0]), [False]])
        edges = np.flatnonzero(np.diff(slipping))
        return [
            (float(theta[end]), float(abs(stretch[end] - stretch[begin])))
            for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
        ]

    def __call__(self, rigs: Numbers, count: int | None = None) -> tuple[FloatArray, FloatArray]:
        """Return (theta [rad], z [m]) of P1 to P`count`, or of all markers, shape (n, count).

        Numbers that are not given are those configured.
        """
        arc, rigs = self.arc[:count], self._configured | rigs
        most = (rigs["load_share"] * self._pull.max() + rigs["guide_drag"]) / rigs["young"]
        most = most / self._area * np.maximum(rigs["start_share"], 1.0)
        top = float(self._at(most, rigs["law_share"]).max())
        reach = 1.03 * min(top, _LONGEST) * arc[-1] / float(self._radius.min()) + 0.5
        if self._commanded is not None:
            # A pull that comes later may draw on what was laid, and the same places for all rigs
            # keep the corners of the pull from wandering among them.
            reach = BEYOND * self.end
        # The lift-off is at most a quarter turn.
        pieces = int(reach / (_STEP if self._commanded is None else _CORNER_STEP)) + 1
        step = reach / pieces
        theta = np.asarray(step * np.arange(pieces + 1), dtype=np.float64)
        most_rows = max(1, _AT_ONCE // theta.size)
        late = self._late(rigs)
        found = np.empty((2, late.size, arc.size))
        for stiff in np.unique(late):
            landing = self._landing(bool(stiff))
            rows = np.flatnonzero(late == stiff)
            for part in np.array_split(rows, math.ceil(rows.size / most_rows)):
                own = {k: value if value.size == 1 else value[part] for k, value in rigs.items()}
                found[:, part] = self._laid(own, landing, arc, theta, step)
        return found[0], found[1]

    def _laid(
        self, rigs: Numbers, known: Landing, arc: FloatArray, theta: FloatArray, step: float
    ) -> tuple[FloatArray, FloatArray]:
        share = rigs["law_share"]
        later, factor = self._bent(rigs, theta)
        span = self._at(self.stress(rigs, theta), share)
        landing = known.at(span)
        behind = rigs["held"][:, None] * landing.held * landing.element
        stress = _held(self.stress(rigs, theta + later + behind), rigs["friction"], step)
        span = self._at(stress, share)
        landing = known.at(span)
        stretch = self._at((stress - self._bending(span)) * (1.0 + landing.excess), share)
        # The section of the span: what bending takes at the landing does not thicken it.
        radius = np.interp(span, self._stretch, self._radius)
        # The node that lands bears what the span pulls aside more than the laid cable.
        yields = 0.5 * stress * landing.element / (landing.stick * span)
        free = rigs["free_length"][:, None] + np.interp(theta, self._angle, self._longer)
        lag = free * factor * (1.0 + landing.lag) / radius
        guide = np.interp(theta + yields, self._angle, self._guide)
        guide = guide + rigs["eye"][:, None] * (theta > 0.0)
        z = landed_z(lag + yields, guide, step)
        slope = np.gradient(z, step, axis=1)
        # Nodes ride where those of the span's chords would on a circle: wound cable has shorter
        # ones, and rising cable shorter ones still that press less.
        rising = slope**2 / (radius**2 + slope**2)
        shorter = 1.0 - (stretch / span) ** 2 * (1.0 - rising)
        sink = stress / (landing.press * span)
        chords = radius * (1.0 + landing.element**2 * (shorter / 24.0 + sink * rising))
        reference = np.hypot(chords, slope) / stretch
        laid = np.zeros_like(reference)
        np.cumsum(0.5 * step * (reference[:, 1:] + reference[:, :-1]), axis=1, out=laid[:, 1:])
        found_theta, found_z = _read(arc, laid, theta, z)
        return found_theta, found_z * (1.0 + rigs["camera_scale"][:, None])

    def _landing(self, late: bool) -> Landing:
        if self._about is None:
            return SHORT_ELEMENTS
        if late not in self._landings:
            known = landing_of(self.config, self._drive, self._about, late=late)
            self._landings[late] = known
        return self._landings[late]

    def _at(self, stress: FloatArray, share: FloatArray) -> FloatArray:
        """Return stretches at stresses over E, shape (n, ...), by each row's C01 share, (n,)."""
        if share.size == 1:
            return np.interp(stress, *self._table(float(share[0])))
        found = np.empty_like(stress)
        stretch = self._table(0.0)[1]
        stresses = np.array([self._table(at)[0] for at in _SHARES])
        for row, place in enumerate(np.interp(share, _SHARES, np.arange(len(_SHARES))).tolist()):
            first = min(int(place), len(_SHARES) - 2)
            one, other = stresses[first : first + 2]
            found[row] = np.interp(stress[row], one + (place - first) * (other - one), stretch)
        return found

    def _table(self, share: float) -> tuple[FloatArray, FloatArray]:
        """Return stresses over E and stretches of the law with a C01 share, shape (p,) each."""
        law = self.config.resolved.law
        if self.config.law in MOONEY:
            law = dataclasses.replace(law, law=MOONEY[1], mooney_ratio=share / (1.0 - share))
        stretch, stress, _ = unit_law(law)
        return stress, stretch

    def _late(self, rigs: Numbers) -> NDArray[np.bool_]:
        """Return for which cables friction holds a landing later, shape (n,)."""
        span = self.config.resolved.lowest_tension / (rigs["young"] * self._area)
        return np.asarray(self._bending(self._at(span, rigs["law_share"])) > STIFF * span)

    def _bending(self, stretch: FloatArray) -> FloatArray:
        return self._bend * stretch / np.interp(stretch, self._stretch, self._radius) ** 2

    def stress(self, rigs: Numbers, theta: FloatArray) -> FloatArray:
        """Return the span's stress over E at wound angles, shape (k,) or (n, k), as (n, k)."""
        pull = np.interp(theta, self._angle, self._pull)
        wound = self.config.case.centreline_radius * theta
        grown = 1.0 - (1.0 - rigs["start_share"][:, None]) * np.exp(
            -wound / rigs["build_up_length"][:, None]
        )
        brake = rigs["brake_friction"]
        if self._commanded is not None and brake.any():
            pull = pull * _behind(self._commanded, brake, theta)
        full = rigs["load_share"][:, None] * pull + rigs["guide_drag"][:, None]
        return np.asarray(full * grown / (rigs["young"][:, None] * self._area))

    def _bent(self, rigs: Numbers, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (lift-off angle [rad], its cosine), shape (n, k)."""
        span = np.maximum(self.stress(rigs, theta), 1.0e-9)
        bending = self._bending(self._at(span, rigs["law_share"]))
        cosine = 1.0 - np.minimum(bending / span, _MOST_BENT)
        return np.arccos(cosine), cosine


def _averaged(angle: FloatArray, values: FloatArray) -> FloatArray:
    """Return means of values about each wound angle, shape (n,), to either side alike."""
    area = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(angle))])
    half = np.minimum(_AVERAGED, np.minimum(angle - angle[0], angle[-1] - angle))
    ends = np.interp([angle + half, angle - half], angle, area)
    return np.where(half > 0.0, (ends[0] - ends[1]) / np.maximum(2.0 * half, 1.0e-12), values)


def _behind(
    commanded: Callable[[FloatArray], FloatArray], friction: FloatArray, theta: FloatArray
) -> FloatArray:
    """Return the tension behind a brake with friction over the pull, shape (n, k).

    Args:
        commanded: Pull [N] at cylinder angles [rad].
        friction: Share of the pull that is held back, shape (n,).
        theta: Ascending angles [rad], shape (k,) or (n, k).
    """
    pulls = commanded(np.broadcast_to(theta, (friction.size, theta.shape[-1])))
    low, high = ((way * friction + 1.0) * pulls.T for way in (-1.0, 1.0))
    held = np.empty_like(low)
    held[0] = pulls[:, 0]
    for k in range(1, held.shape[0]):
        np.maximum(held[k - 1], low[k], out=held[k])
        np.minimum(held[k], high[k], out=held[k])
    return held.T / pulls


def _held(span: FloatArray, friction: FloatArray, step: float) -> FloatArray:
    """Return what stays on the cylinder of a span's tension, shape (n, k).

    Args:
        span: Tension as cable lands, or what is proportional to it, shape (n, k).
        friction: Shape (n,) or (1,).
        step: Between two places [rad].
    """
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


def _drive_of(inputs: Inputs) -> DriveProfile:
    """Return a drive with the top speeds of inputs."""
    speed, feed = float(inputs["angular_speed"].max()), inputs["feed_speed"]
    if not speed > 0.0:
        return DriveProfile()
    return DriveProfile(angular_speed=speed, feed_speed=float(feed[np.abs(feed).argmax()]))


def _read(
    arc: FloatArray, laid: FloatArray, theta: FloatArray, z: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return theta and z where the laid length is that of the markers, shape (n, m) each."""
    rows = np.arange(laid.shape[0])
    found_theta, found_z = np.empty((2, laid.shape[0], arc.size))
    for marker, length in enumerate(arc):
        after = np.clip((laid < length).sum(axis=1), 1, theta.size - 1)
        low, high = laid[rows, after - 1], laid[rows, after]
        share = (length - low) / (high - low)
        found_theta[:, marker] = theta[after - 1] + share * (theta[after] - theta[after - 1])
        found_z[:, marker] = z[rows, after - 1] + share * (z[rows, after] - z[rows, after - 1])
    return found_theta, found_z
