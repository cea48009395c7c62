"""Closed-form lay of many rigs at once, with what bending and friction do at the landing.

Beyond `quasi_static.lay` a cable with bending stiffness touches the cylinder phi = arccos(1 - b)
late, with b = EI l / (2 F rho^2), so that it lands under the tension of a little later and with the
lag L cos(phi) / rho; friction holds no tension that rises along the cable faster than the capstan
law allows; and the rod's elements and contact add what `landing` finds.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.identification.landing import Landing, landing_of
from cable_fem_node.identification.quasi_static import landed_z, turning, unit_law
from cable_fem_node.identification.rig import Rigs
from cable_fem_node.identification.tracked_run import IdentificationError, Readings, TrackedRun
from cable_fem_node.winding.resolved_model import STIFF
from winding_core.machine.drive import DriveProfile
from winding_core.run_inputs import Inputs, continued_inputs

# Where bending would take more than this, no cable lies on the cylinder any more.
_MOST_BENT = 0.9
# Between two places of the grid [rad]: against 0.01 no angle of 150 rigs moved by 0.15 mrad.
_STEP = 0.2
# Places of all rigs that are held at once; beyond, rigs come in turn.
_AT_ONCE = 400_000
# No cable of this model is longer than this many times its length.
_LONGEST = 4.0


class RigLay:
    """Where the markers of one run would lie, rig by rig.

    Args:
        run: Inputs, condition and markers; its law and friction hold for all rigs.

    Raises:
        IdentificationError: The cylinder does not turn far enough for the run's markers.
    """

    def __init__(self, run: TrackedRun) -> None:
        config, case = run.config, run.config.case
        self._config = config
        self.arc = np.asarray(
            case.marker_spacing * np.arange(1, case.marker_count + 1), dtype=float
        )
        reach = _LONGEST * self.arc[-1] / case.cylinder_radius + 2.0
        inputs, span = turning(continued_inputs(run.inputs, reach), config)
        # Beyond the free length of a guide that keeps its place.
        self._longer = span - config.free_length
        self._angle = inputs["cylinder_angle"]
        if self._angle[-1] < run.readings.theta[-1]:
            raise IdentificationError(
                f"P{run.readings.ids[-1]} does not land within the run: it was measured at "
                f"{run.readings.theta[-1]:.4g} rad, the cylinder turns by {self._angle[-1]:.4g} rad"
            )
        self._guide = inputs["carriage_position"]
        self._pull = run.tensions(inputs)
        self._area = case.axial_area
        law = config.resolved.law
        self._stretch, self._stress, lateral = unit_law(law)
        self._lateral = lateral if config.resolved.thins else np.ones_like(lateral)
        self._radius = case.cylinder_radius + case.cable_radius * self._lateral
        # EI / (2 EA): bending's share of a stress over E.
        self._bend = 0.5 * case.bending_stiffness / (case.material.young * case.axial_area)
        self._about = self._span_stretch(run.readings)
        self._drive = _drive_of(run.inputs)
        self._landings: dict[bool, Landing] = {}

    def _span_stretch(self, readings: Readings) -> float:
        """Return about the stretch of the span, from the last marker."""
        radius = self._config.case.centreline_radius
        length = np.hypot(radius * readings.theta[-1], readings.z[-1])
        wound = max(float(length) / self.arc[readings.ids[-1] - 1], 1.0)
        bent = self._bend * wound / radius**2
        return float(self._at(np.asarray(self.stress_of(wound) + bent)))

    def mean_pull(self, angle: float) -> float:
        """Return the mean stated tension [N] until the cylinder has turned by an angle [rad]."""
        return float(self._pull[: max(1, np.searchsorted(self._angle, angle))].mean())

    def stress_of(self, stretch: float) -> float:
        """Return the nominal stress over E under a stretch."""
        return float(np.interp(stretch, self._stretch, self._stress))

    def added_stretch(self) -> float:
        """Return what elements and contact of the rod add to the stretch of the run, relative."""
        known = self._landing(self._config.resolved.constants.late > 0)
        stress = np.array([self.stress_of(self._about)])
        more = self._at(stress * (1.0 + known.at(self._at(stress)).excess)) / self._about
        return abs(float(more[0]) - 1.0)

    def __call__(self, rigs: Rigs, count: int | None = None) -> tuple[FloatArray, FloatArray]:
        """Return (theta [rad], z [m]) of P1 to P`count`, or of all markers, shape (n, count)."""
        arc = self.arc[:count]
        most = (rigs.load_share * self._pull.max() + rigs.guide_drag) / (rigs.young * self._area)
        top = float(self._at(most * np.maximum(rigs.start_share, 1.0)).max())
        reach = 1.03 * min(top, _LONGEST) * arc[-1] / float(self._radius.min()) + 0.5
        # The lift-off is at most a quarter turn.
        pieces = int(reach / _STEP) + 1
        step = reach / pieces
        theta = np.asarray(step * np.arange(pieces + 1), dtype=np.float64)
        most_rows = max(1, _AT_ONCE // theta.size)
        late = self._late(rigs)
        found = np.empty((2, late.size, arc.size))
        for stiff in np.unique(late):
            landing = self._landing(bool(stiff))
            rows = np.flatnonzero(late == stiff)
            for part in np.array_split(rows, math.ceil(rows.size / most_rows)):
                found[:, part] = self._laid(rigs.part(part), landing, arc, theta, step)
        return found[0], found[1]

    def _laid(
        self, rigs: Rigs, known: Landing, arc: FloatArray, theta: FloatArray, step: float
    ) -> tuple[FloatArray, FloatArray]:
        later, factor = self._bent(rigs, theta)
        span = self._at(self._span(rigs, theta))
        landing = known.at(span)
        behind = rigs.held[:, None] * landing.held * landing.element
        stress = self._landed(rigs, theta + later + behind, step)
        span = self._at(stress)
        landing = known.at(span)
        stretch = self._at((stress - self._bending(span)) * (1.0 + landing.excess))
        # The section of the span: what bending takes at the landing does not thicken it.
        radius = np.interp(span, self._stretch, self._radius)
        # The node that lands bears what the span pulls aside more than the laid cable.
        yields = 0.5 * stress * landing.element / (landing.stick * span)
        free = rigs.free_length[:, None] + np.interp(theta, self._angle, self._longer)
        lag = free * factor * (1.0 + landing.lag) / radius
        guide = np.interp(theta + yields, self._angle, self._guide)
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
        return _read(arc, laid, theta, z)

    def _landing(self, late: bool) -> Landing:
        if late not in self._landings:
            known = landing_of(self._config, self._drive, self._about, late=late)
            self._landings[late] = known
        return self._landings[late]

    def _at(self, stress: FloatArray) -> FloatArray:
        return np.interp(stress, self._stress, self._stretch)

    def _late(self, rigs: Rigs) -> NDArray[np.bool_]:
        """Return for which cables friction holds a landing later, shape (n,)."""
        span = self._config.resolved.lowest_tension / (rigs.young * self._area)
        return np.asarray(self._bending(self._at(span)) > STIFF * span)

    def _bending(self, stretch: FloatArray) -> FloatArray:
        return self._bend * stretch / np.interp(stretch, self._stretch, self._radius) ** 2

    def _span(self, rigs: Rigs, theta: FloatArray) -> FloatArray:
        """Return the span's stress over E at wound angles, shape (n, k)."""
        pull = np.interp(theta, self._angle, self._pull)
        wound = self._config.case.centreline_radius * theta
        grown = 1.0 - (1.0 - rigs.start_share[:, None]) * np.exp(
            -wound / rigs.build_up_length[:, None]
        )
        full = rigs.load_share[:, None] * pull + rigs.guide_drag[:, None]
        return np.asarray(full * grown / (rigs.young[:, None] * self._area))

    def _bent(self, rigs: Rigs, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (lift-off angle [rad], its cosine), shape (n, k)."""
        span = np.maximum(self._span(rigs, theta), 1.0e-9)
        cosine = 1.0 - np.minimum(self._bending(self._at(span)) / span, _MOST_BENT)
        return np.arccos(cosine), cosine

    def _landed(self, rigs: Rigs, theta: FloatArray, step: float) -> FloatArray:
        """Return the stress over E that stays on the cylinder, shape (n, k)."""
        span = self._span(rigs, theta)
        held = np.exp(self._config.friction * step * np.arange(span.shape[1]))
        highest = np.maximum.accumulate((span / held)[:, ::-1], axis=1)[:, ::-1]
        return np.asarray(highest * held)


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
