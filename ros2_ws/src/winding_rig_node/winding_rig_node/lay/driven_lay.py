"""The lay that the machine's own motion makes, whatever the axes and the brake do."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from winding_core.cable.cases import Case
from winding_core.helix import free_length_of, guide_distance_of
from winding_core.lay.layers import FULL_TURN, contact_height
from winding_core.machine.drum import Drum
from winding_core.machine.readings import GuidePlace
from winding_rig_node.lay.lay_law import LaidPath, LaidPoint, LayTruth, LayView
from winding_rig_node.lay.lay_on import (
    GRID_STEP,
    Contact,
    HiddenRig,
    cable_of,
    contact_at_start,
    lay_on,
)

FloatArray = NDArray[np.float64]

_ROOM = 4096
# Cable that lands by more than this of its diameter beside its neighbour slides off it, down to
# its own level; nearer to its top it climbs.
_SLIDES = 0.5
_GIVES = 0.05  # Neighbours give way by so much of a diameter
_LEVEL = 0.5  # Cable that lies so much of a diameter above another one does not lie beside it
_BEARS = 0.1  # Of what cable lies on, all that is so nearly as high bears it, in diameters


class Rest(NamedTuple):
    """Where cable comes to rest."""

    z: float  # Axial position [m]
    radius: float  # Of the centre line [m]
    layer: int  # From 1 on the drum


class LaidTurns:
    """The turns on a drum, point by point.

    A point rests on what was laid at the same place of the circumference before. Cable that it
    touches u beside it holds it sqrt(d^2 - u^2) higher (`winding_core.lay.layers.contact_height`);
    of all that it touches the highest counts, and the drum where there is none. The turn before on
    its own level pushes it aside where there is room for it, up to the flange; a flange is passed
    nowhere. Whatever else lies below does not move it: it sticks where it lands.

    Args:
        drum: Between whose flanges.
        case: What is wound; its undeformed diameter counts.
    """

    def __init__(self, drum: Drum, case: Case) -> None:
        self._diameter = case.cable_diameter
        self._bare = case.centreline_radius
        self._low, self._high = drum.centre_lines(case.cable_diameter)
        # Rows: wound angle [rad], axial position [m], radius [m], layer.
        self._points = np.zeros((4, _ROOM))
        self.restart()

    def restart(self) -> None:
        """Begin anew with P0 on the drum."""
        self._points[:, 0] = 0.0, 0.0, self._bare, 1.0
        self._count = 1

    @property
    def radius(self) -> FloatArray:
        """Radii of the centre line [m], shape (n,); a view."""
        return self._points[2, : self._count]

    @property
    def layer(self) -> NDArray[np.int64]:
        """Layers, from 1 on the drum, shape (n,)."""
        return self._points[3, : self._count].astype(np.int64)

    @property
    def last(self) -> Rest:
        """The newest point."""
        _, z, radius, layer = self._points[:, self._count - 1].tolist()
        return Rest(z, radius, int(layer))

    def within(self, z: float) -> float:
        """Return an axial position [m] between the flanges."""
        return min(max(z, self._low), self._high)

    def append(self, theta: float, z: float) -> Rest:
        """Lay the next point, which the span leads to an axial position.

        Args:
            theta: Its wound angle, beyond the last one [rad].
            z: Where the span leads it [m].

        Returns:
            Where it comes to rest.
        """
        rest = self._rest(theta, self.within(z))
        if self._count == self._points.shape[1]:
            self._points = np.concatenate([self._points, np.zeros_like(self._points)], axis=1)
        self._points[:, self._count] = theta, *rest
        self._count += 1
        return rest

    def take_back(self, count: int) -> None:
        """Forget all points but the first so many, at least P0."""
        self._count = max(count, 1)

    def _rest(self, theta: float, z: float) -> Rest:
        before = theta - FULL_TURN * np.arange(1, math.floor(theta / FULL_TURN) + 1)
        if not before.size:
            return Rest(z, self._bare, 1)
        known = self._points[:, : self._count]
        at = np.searchsorted(known[0], before, side="right") - 1
        places, radii = (np.interp(before, known[0], known[row]) for row in (1, 2))
        below = np.array([places, radii, known[3, at]])
        older, neighbour, radius = below[:, 1:], float(places[0]), float(radii[0])
        beside = z - neighbour
        if abs(beside) < self._diameter and self._beside(z, radius, older):
            aside = neighbour + math.copysign(self._diameter, beside)
            room = abs(aside - self.within(aside)) <= _GIVES * self._diameter
            aside = self.within(aside)
            slides = room and abs(beside) >= _SLIDES * self._diameter
            if slides and self._beside(aside, radius, older):
                return self._on(aside, older)
        return self._on(z, below)

    def _beside(self, z: float, radius: float, older: FloatArray) -> bool:
        """Return whether cable would come down at z [m] beside the turn before at a radius [m]."""
        return self._on(z, older).radius < radius + _LEVEL * self._diameter

    def _on(self, z: float, below: FloatArray) -> Rest:
        """Return how cable lies at z [m] on cable: rows z, radius, layer, shape (3, n)."""
        d = self._diameter
        touched = below[:, np.abs(z - below[0]) < (1.0 - _GIVES) * d]
        if not touched.shape[1]:
            return Rest(z, self._bare, 1)
        heights = touched[1] + contact_height(d, z - touched[0])
        highest = float(heights.max())
        bearing = touched[2, heights > highest - _BEARS * d]
        return Rest(z, max(highest, self._bare), int(bearing.max()) + 1)


def drawn_lay(case: Case, rng: np.random.Generator, drum: Drum | None = None) -> DrivenLay:
    """Return the lay of a case on a rig that is drawn, between the flanges of a drum if any.

    Raises:
        ValueError: The cable's stress fades.
    """
    case.material.refuse_fading("lay 'driven'")
    return DrivenLay(case, HiddenRig.drawn(rng), drum)


class DrivenLay:
    """A cable that sticks where it lands, wound by any motion of both axes under any pull.

    The eye of the guide follows the carriage with its play. A free span without bending stiffness
    is straight and tangent to the lay at the contact line: z + L z' = eye, where z' is the lay's
    rise per way rho Theta. With bending stiffness EI its end is bent over l = sqrt(EI / T), and
    the moment there is that of the cable on the cylinder:

        z + L z' + l (L - l) z'' = eye,

    which is a lag of L - l and one of l in a row. Each step is the exact solution for an eye that
    moves in proportion to the angle. Undeformed length is laid at hypot(rho, dz/dTheta) / lambda
    per radian, lambda being the neo-Hookean stretch under the span's tension less
    EI lambda / (2 rho^2) for bending (`winding_core.lay.quasi_static`).

    A standing cylinder lays nothing. One that turns backwards takes cable off again: path,
    length and markers beyond the contact line are forgotten, and what is wound from there on is
    laid anew. Behind P0 the cable is clamped: there nothing is laid either.

    A guide on an arm stands where it is reported, but for one error along the span that makes its
    first free length the hidden one.

    On a drum cable comes to rest on what lies there (`LaidTurns`), and its radius rho with it: the
    guide keeps its distance from the axis, so the span of the next step is sqrt(distance^2 - rho^2)
    long. What pushes cable aside where it lies does not move the end of the span.

    Args:
        case: What is wound.
        hidden: What the rig does to it.
        drum: Between whose flanges it is wound; None for a cylinder without ends.

    Attributes:
        case: What is wound.
        hidden: What the rig does to it.
        path: Points of the lay, `GRID_STEP` or more apart; the contact line is beyond the last.
        marker_theta: Wound angles of P0 to the last marker [rad], shape (marker_count + 1,);
            nan for those that have not landed.
    """

    def __init__(self, case: Case, hidden: HiddenRig, drum: Drum | None = None) -> None:
        self.case = case
        self.hidden = hidden
        self._turns = None if drum is None else LaidTurns(drum, case)
        self._distance = guide_distance_of(hidden.free_length, case.centreline_radius)
        self._cable = cable_of(case, hidden)
        self.restart()

    def restart(self) -> None:
        """Begin anew with P0 at the contact line and the guide in the middle of its play."""
        self.path = LaidPath()
        self.marker_theta = np.full(self.case.marker_count + 1, math.nan)
        self.marker_theta[0] = 0.0
        self._contact = contact_at_start()
        self._angle = self._carriage = self._aside = 0.0
        # By how much the eye stands further along y than is reported, from its first place on [m].
        self._stands: float | None = None
        if self._turns is not None:
            self._turns.restart()
            self._lie_at(self.case.centreline_radius)

    @property
    def wound_angle(self) -> float:
        """Wound angle behind P0 at the contact line [rad]."""
        return max(self._angle, 0.0)

    @property
    def contact(self) -> Contact:
        """The cable at the contact line now."""
        return Contact(*self._contact.item())

    @property
    def z(self) -> float:
        """Axial position of the cable at the contact line [m]."""
        return float(self._contact["z"][0]) + self._aside

    @property
    def length(self) -> float:
        """Undeformed cable from P0 to the contact line [m]."""
        return float(self._contact["length"][0])

    def advance(
        self, angle: float, carriage: float, pull: float, guide: GuidePlace | None = None
    ) -> None:
        """Go on to where both axes stand now.

        Args:
            angle: Of the cylinder [rad].
            carriage: Its position [m].
            pull: On the cable at the guide [N].
            guide: Where the eye is reported across the axis; None where it keeps its place.

        Raises:
            ValueError: One of them is not finite.
        """
        if guide is not None:
            angle -= self._led_from(guide)
        if not math.isfinite(angle + carriage + pull):
            raise ValueError(
                f"a lay needs finite numbers, got {angle} rad, {carriage} m and {pull} N"
            )
        turned = angle - self._angle
        if turned > GRID_STEP:
            self._advance_in_parts(angle, carriage, pull)
            return
        if turned < 0.0:
            self._take_back(angle)
        self._angle, self._carriage = angle, carriage
        if lay_on(self._contact, self._cable, self.marker_theta, angle, carriage, pull):
            self._come_to_rest()
            self.path.append(angle, self.z, self.length)

    def z_at(self, theta: ArrayLike) -> FloatArray:
        """Return the axial position [m] at wound angles [rad], same shape; nan beyond the lay."""
        return self.path.along(theta, self._end)[0]

    def view(self) -> LayView:
        """Return the lay as it is, by what has changed since the last view."""
        contact, growth = self.contact, self.path.growth()
        lift, landing_lift = growth.theta[:0], 0.0
        if self._turns is not None:
            bare = self.case.centreline_radius
            lift = self._turns.radius[growth.kept :] - bare
            landing_lift = self._turns.last.radius - bare
        return LayView(
            growth=growth,
            theta=self.wound_angle,
            z=self.z,
            slope=contact.slope,
            eye=contact.eye,
            free_length=self._free_length,
            marker_theta=self._shown(contact),
            lift=lift,
            landing_lift=landing_lift,
        )

    def renew_view(self) -> None:
        """Have the next view begin with P0."""
        self.path.renew_growth()

    def truth(self, turned: float) -> LayTruth:
        """Return where the cable lies, up to its own contact line, and what the rig did to it."""
        truth = self.path.truth(self._end, self.marker_theta, asdict(self.hidden))
        if self._turns is None:
            return truth
        last = self._turns.last
        return truth._replace(
            radius=np.append(self._turns.radius, last.radius),
            layer=np.append(self._turns.layer, last.layer),
        )

    def _come_to_rest(self) -> None:
        """Have the point that is to be kept lie on what is below it."""
        if self._turns is None:
            return
        contact = self._contact
        led = float(contact["z"][0])
        held = self._turns.within(led)
        if held != led:
            # Against a flange the span ends where the cable does.
            contact["z"], contact["slope"] = held, 0.0
        rest = self._turns.append(self._angle, held)
        self._aside = rest.z - held
        self._lie_at(rest.radius)

    def _lie_at(self, radius: float) -> None:
        """Have what is laid next lie at a radius [m]."""
        self._cable["rho"] = radius
        self._cable["free_length"] = free_length_of(self._distance, radius)

    def _led_from(self, guide: GuidePlace) -> float:
        """Take where the eye is reported; return the azimuth at which cable lands from there."""
        if self._stands is None:
            # The span is as hidden as that of a carriage: what stands wrong does so throughout.
            self._stands = guide.y + self.hidden.free_length
        true = GuidePlace(x=guide.x, y=guide.y - self._stands)
        self._distance = math.hypot(true.x, true.y)
        self._lie_at(float(self._cable["rho"][0]))
        return true.landing(self.case.centreline_radius)

    @property
    def _free_length(self) -> float:
        """Tangent span between the contact line and the eye now [m]."""
        return float(self._cable["free_length"][0])

    @property
    def _end(self) -> LaidPoint:
        return LaidPoint(self.wound_angle, self.z, self.length)

    def _shown(self, contact: Contact) -> FloatArray:
        shown = self.marker_theta.copy()
        if contact.next == shown.size:
            return shown
        span, wound = self._free_length, self.wound_angle
        along = contact.span_stretch * span / math.hypot(span, contact.eye - self.z)
        for n in range(int(contact.next), shown.size):
            way = along * (n * self.case.marker_spacing - contact.length)
            if way > span:
                break
            shown[n] = wound + way / self.case.centreline_radius
        return shown

    def _advance_in_parts(self, angle: float, carriage: float, pull: float) -> None:
        """Go on in small steps, the carriage in proportion to the angle."""
        before, came = self._angle, self._carriage
        parts = math.ceil((angle - before) / GRID_STEP)
        for part in range(1, parts):
            share = part / parts
            self.advance(before + (angle - before) * share, came + (carriage - came) * share, pull)
        self.advance(angle, carriage, pull)

    def _take_back(self, angle: float) -> None:
        """Take cable off until the contact line stands at a cylinder angle [rad] again."""
        path, contact, end = self.path, self._contact, max(angle, 0.0)
        if end >= self.wound_angle:
            return
        k = int(np.searchsorted(path.theta, end, side="left"))
        after = np.array(path.point(k) if k < path.theta.size else self._end)
        path.take_back(end)
        before = np.array(path.point(-1))
        slope = length_per_angle = 0.0
        if end > 0.0:
            _, slope, length_per_angle = (after - before) / (after[0] - before[0])
        turned = end - before[0]
        contact["z"], contact["slope"] = before[1] + turned * slope, slope
        contact["length"] = before[2] + turned * length_per_angle
        self.marker_theta[self.marker_theta > end] = math.nan
        contact["next"] = np.isfinite(self.marker_theta).sum()
        contact["last"] = before[0]
        self._aside = 0.0
        if self._turns is not None:
            self._turns.take_back(path.theta.size)
            self._lie_at(self._turns.last.radius)
