"""The lay that the machine's own motion makes, whatever the axes and the brake do."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from winding_core.cases import Case
from winding_rig_node.machine.hidden_rig import HiddenRig
from winding_rig_node.machine.laid_path import LaidPath
from winding_rig_node.machine.lay import neo_hookean_stretch

FloatArray = NDArray[np.float64]

# Angle between points of the path that are kept, and the largest step of one integration [rad].
GRID_STEP = 0.02
# The bent end of the span is short beside the span; a slack cable would make it endless.
_LONGEST_BENT_END = 0.25


class DrivenLay:
    """A cable that sticks where it lands, wound by any motion of both axes under any pull.

    The eye of the guide follows the carriage with its play. A free span without bending stiffness
    is straight and tangent to the lay at the contact line, so rho dz/d(rho Theta) L = eye - z.
    With bending stiffness EI its end is bent over l = sqrt(EI / T), and the moment there is
    that of the cable on the cylinder:

        z + L z' + l (L - l) z'' = eye,  z' = dz/d(rho Theta),

    which is a lag of L - l and one of l in a row. Each step is the exact solution for an eye that
    moves in proportion to the angle. Undeformed length is laid at hypot(rho, dz/dTheta) / lambda
    per radian, lambda being the neo-Hookean stretch under the span's tension less
    EI lambda / (2 rho^2) for bending (`winding_core.quasi_static`).

    A standing cylinder lays nothing. One that turns backwards takes cable off again: path,
    length and markers beyond the contact line are forgotten, and what is wound from there on is
    laid anew. Behind P0 the cable is clamped: there nothing is laid either.

    Args:
        case: What is wound.
        hidden: What the rig does to it.

    Attributes:
        case: What is wound.
        hidden: What the rig does to it.
        path: Points of the lay, `GRID_STEP` or more apart; the contact line is beyond the last.
        eye: Where the eye of the guide stands [m].
        z: Axial position at the contact line [m].
        slope: dz/dTheta there [m/rad].
        length: Undeformed cable from P0 to the contact line [m].
        tension: Of the span at the contact line [N].
        marker_theta: Wound angles of P0 to the last marker [rad], shape (marker_count + 1,);
            nan for those that have not landed.
    """

    def __init__(self, case: Case, hidden: HiddenRig) -> None:
        self.case = case
        self.hidden = hidden
        young = case.material.young
        self._axial = case.section_area * young * case.material.axial_factor
        self._bending = hidden.bending * case.bending_stiffness
        self._rho = case.centreline_radius
        self.restart()

    def restart(self) -> None:
        """Begin anew with P0 at the contact line and the guide in the middle of its play."""
        self.path = LaidPath()
        self.eye = self.z = self.slope = self.length = self.tension = 0.0
        self.marker_theta = np.full(self.case.marker_count + 1, np.nan)
        self.marker_theta[0] = 0.0
        # Number of the marker that lands next, and angle of the path's last point.
        self._next, self._last = 1, 0.0
        self._angle = 0.0
        self._pull: float | None = None
        self._span_stretch = self._stretch = 1.0

    @property
    def wound_angle(self) -> float:
        """Wound angle behind P0 at the contact line [rad]."""
        return max(self._angle, 0.0)

    @property
    def span_stretch(self) -> float:
        """Stretch of the free span."""
        return self._span_stretch

    def advance(self, angle: float, carriage: float, pull: float) -> None:
        """Go on to where both axes stand now.

        Args:
            angle: Of the cylinder [rad].
            carriage: Its position [m].
            pull: On the cable at the guide [N].

        Raises:
            ValueError: One of them is not finite.
        """
        if not math.isfinite(angle + carriage + pull):
            raise ValueError(
                f"a lay needs finite numbers, got {angle} rad, {carriage} m and {pull} N"
            )
        before, eye_before = self._angle, self.eye
        half = 0.5 * self.hidden.guide_play
        self.eye = eye = min(max(eye_before, carriage - half), carriage + half)
        self._hold(pull)
        if angle == before:
            return
        if angle < before:
            self._take_back(angle)
        elif angle > 0.0:
            start = max(before, 0.0)
            turned = angle - start
            parts = max(math.ceil(turned / GRID_STEP), 1)
            for part in range(parts):
                self._wind(
                    start + turned * part / parts,
                    turned / parts,
                    eye_before + (eye - eye_before) * part / parts,
                    (eye - eye_before) / turned,
                )
        self._angle = angle

    def z_at(self, theta: ArrayLike) -> FloatArray:
        """Return the axial position [m] at wound angles [rad], same shape; nan beyond the lay."""
        return self._along(self.path.z, self.z, theta)

    def length_at(self, theta: ArrayLike) -> FloatArray:
        """Return the undeformed length since P0 [m] at wound angles [rad]; nan beyond the lay."""
        return self._along(self.path.length, self.length, theta)

    def shown_markers(self) -> FloatArray:
        """Return the wound angles of the markers, those in the free span included [rad].

        One in the span is as many radians beyond the contact line as its way to there is long on
        the cylinder, shape (marker_count + 1,); nan for one that has not come to the eye yet.
        """
        shown = self.marker_theta.copy()
        span = self.hidden.free_length
        rise = (self.eye - self.z) / span
        for n in range(self._next, shown.size):
            ahead = n * self.case.marker_spacing - self.length
            way = self._span_stretch * ahead / math.hypot(1.0, rise)
            if way > span:
                break
            shown[n] = self._angle + way / self._rho
        return shown

    def _hold(self, pull: float) -> None:
        """Have the cable pulled, with the brake's friction between it and the guide."""
        held, friction = self._pull, self.hidden.brake_friction
        if held is None:
            held = pull
        low, high = (1.0 - friction) * pull, (1.0 + friction) * pull
        self._pull = max(min(max(held, low), high), 0.0)

    def _wind(self, theta: float, turned: float, eye: float, advance: float) -> None:
        """Wind on from a wound angle [rad].

        Args:
            theta: Wound angle at the contact line [rad].
            turned: By how much the cylinder turns [rad].
            eye: Where the eye stands [m].
            advance: How far it goes per radian [m/rad].
        """
        rho = self._rho
        self._stretch_at(rho * (theta + 0.5 * turned))
        bent_end = 0.0
        if self._bending > 0.0:
            bent_end = _LONGEST_BENT_END * self.hidden.free_length
            if self.tension * bent_end**2 > self._bending:
                bent_end = math.sqrt(self._bending / self.tension)
        slow, quick = (self.hidden.free_length - bent_end) / rho, bent_end / rho
        # Where the lay runs in the end is exact; two differences from it die away.
        behind = advance * (slow + quick)
        off = self.z - eye + behind
        short = 0.0
        if quick > 0.0:
            short = -((self.slope - advance) * slow + off) * quick / (slow - quick)
        faded = (off - short) * math.exp(-turned / slow)
        short = short * math.exp(-turned / quick) if quick > 0.0 else 0.0
        z = eye + advance * turned - behind + faded + short
        self.slope = advance - faded / slow - (short / quick if quick > 0.0 else 0.0)
        laid = math.hypot(rho * turned, z - self.z) / self._stretch
        after = theta + turned
        while self._next < self.marker_theta.size:
            left = self._next * self.case.marker_spacing - self.length
            if left > laid:
                break
            self.marker_theta[self._next] = theta + turned * left / laid
            self._next += 1
        self.z = z
        self.length += laid
        if after - self._last >= GRID_STEP:
            self.path.append(after, z, self.length)
            self._last = after

    def _stretch_at(self, wound: float) -> None:
        """Set tension and stretches of the cable where so much [m] is wound."""
        hidden = self.hidden
        assert self._pull is not None
        built = 1.0 - (1.0 - hidden.start_share) * math.exp(-wound / hidden.build_up_length)
        self.tension = tension = (hidden.drag + hidden.load_share * self._pull) * built
        load = tension / self._axial
        self._span_stretch = span = neo_hookean_stretch(load, self._span_stretch)
        bent = 0.5 * self._bending * span / (self._rho**2 * self._axial)
        self._stretch = neo_hookean_stretch(load - bent, self._stretch) if bent else span

    def _take_back(self, angle: float) -> None:
        """Take cable off until the contact line stands at a cylinder angle [rad] again."""
        path, end = self.path, max(angle, 0.0)
        if end >= self.wound_angle:
            return
        k = int(np.searchsorted(path.theta, end, side="left"))
        after = self.wound_angle, self.z, self.length
        if k < path.theta.size:
            after = float(path.theta[k]), float(path.z[k]), float(path.length[k])
        path.take_back(end)
        theta, z, length = float(path.theta[-1]), float(path.z[-1]), float(path.length[-1])
        self.slope = (after[1] - z) / (after[0] - theta) if end > 0.0 else 0.0
        self.z = z + self.slope * (end - theta)
        self.length = length
        if end > 0.0:
            self.length += (after[2] - length) * (end - theta) / (after[0] - theta)
        self.marker_theta[self.marker_theta > end] = math.nan
        self._next = int(np.isfinite(self.marker_theta).sum())
        self._last = theta

    def _along(self, values: FloatArray, end: float, theta: ArrayLike) -> FloatArray:
        """Interpolate values of the path, and on to their value at the contact line."""
        theta = np.asarray(theta, dtype=float)
        known, contact = self.path.theta, self.wound_angle
        found = np.interp(theta, known, values)
        if contact > known[-1]:
            share = (theta - known[-1]) / (contact - known[-1])
            found = np.where(share > 0.0, values[-1] + share * (end - values[-1]), found)
        return np.where((theta >= 0.0) & (theta <= contact), found, math.nan)
