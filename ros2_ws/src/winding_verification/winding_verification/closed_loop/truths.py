"""What really happens to the cable: the rig's own lay, or the explicit rod."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cases import Case
from winding_core.readings import AxisReading
from winding_core.tension import RigTension
from winding_rig_node.lay.driven_lay import DrivenLay
from winding_rig_node.lay.lay_on import HiddenRig

Array = NDArray[np.float64]
TRUTHS = ("driven", "rod")

# Samples of the machine between two advances of the rod.
_ROD_STRIDE = 10


class Truth(Protocol):
    """A cable under the motion of the machine."""

    def advance(self, t: float, reading: AxisReading, pull: float) -> None:
        """Go on to a time [s], the axes as they truly stand, under a pull at the guide [N]."""
        ...

    def z_at(self, theta: ArrayLike) -> Array:
        """Return where the cable lies [m] at wound angles [rad], same shape."""
        ...

    def marker_theta(self) -> Array:
        """Return wound angles of P1 to the last marker [rad]; nan for one that has not landed."""
        ...


class DrivenTruth:
    """The lay of the simulated rig: it sticks where it lands.

    Args:
        case: What is wound.
        hidden: What the rig does to it.
    """

    def __init__(self, case: Case, hidden: HiddenRig) -> None:
        self._lay = DrivenLay(case, hidden)

    def advance(self, t: float, reading: AxisReading, pull: float) -> None:
        """Go on to a time [s], the axes as they truly stand, under a pull at the guide [N]."""
        self._lay.advance(reading.cylinder_angle, reading.carriage_position, pull)

    def z_at(self, theta: ArrayLike) -> Array:
        """Return where the cable lies [m] at wound angles [rad], same shape."""
        return self._lay.z_at(theta)

    def marker_theta(self) -> Array:
        """Return wound angles of P1 to the last marker [rad]; nan for one that has not landed."""
        return self._lay.marker_theta[1:].copy()


class RodTruth:
    """The explicit rod with contact and friction, behind the same hidden rig.

    Its law of the lag is its own: bending, inertia and slip are those of the finite elements.

    Args:
        case: What is wound.
        hidden: What the rig does to it; its bending is the rod's own.
        friction: Of cable on cylinder.
    """

    def __init__(self, case: Case, hidden: HiddenRig, friction: float) -> None:
        self._hidden, self._radius = hidden, case.centreline_radius
        self._rod = RodWinding(
            WindingConfig(
                case=case, friction=friction, law="neo_hookean", free_length=hidden.free_length
            )
        )
        self._build_up = RigTension(
            start_share=hidden.start_share, build_up_length=hidden.build_up_length
        )
        self._spacing = case.marker_spacing * np.arange(1, case.marker_count + 1)
        self._diameter = case.cylinder_diameter
        self._eye = 0.0
        self._held = case.weight
        self._samples = 0
        self._path: tuple[Array, Array, Array] | None = None

    def advance(self, t: float, reading: AxisReading, pull: float) -> None:
        """Go on to a time [s], the axes as they truly stand, under a pull at the guide [N]."""
        hidden = self._hidden
        play = 0.5 * hidden.guide_play
        carriage = reading.carriage_position
        self._eye = min(max(self._eye, carriage - play), carriage + play)
        band = hidden.brake_friction * pull
        self._held = min(max(self._held, pull - band), pull + band)
        self._samples += 1
        if self._samples % _ROD_STRIDE:
            return
        final = hidden.load_share * self._held + hidden.drag
        wound = self._radius * max(reading.cylinder_angle, 0.0)
        moving = self._eye in (carriage - play, carriage + play)
        self._rod.advance_to(
            t,
            AxisReading(
                cylinder_angle=reading.cylinder_angle,
                angular_speed=reading.angular_speed,
                carriage_position=self._eye,
                feed_speed=reading.feed_speed if moving else 0.0,
            ),
            self._build_up(final, self._diameter, wound),
        )
        self._path = None

    def z_at(self, theta: ArrayLike) -> Array:
        """Return where the cable lies [m] at wound angles [rad], same shape."""
        _, wound, z = self._wound()
        return np.asarray(np.interp(np.asarray(theta, dtype=float), wound, z, right=np.nan))

    def marker_theta(self) -> Array:
        """Return wound angles of P1 to the last marker [rad]; nan for one that has not landed."""
        arc, wound, _ = self._wound()
        return np.asarray(np.interp(self._spacing, arc, wound, right=np.nan))

    def _wound(self) -> tuple[Array, Array, Array]:
        if self._path is None:
            self._path = self._rod.wound_path()
        return self._path
