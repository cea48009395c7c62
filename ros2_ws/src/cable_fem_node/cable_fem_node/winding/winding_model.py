"""What the rod and the solid have in common when they are wound: motion, markers, energies."""

import copy
import math
from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.state import LEDGER_SIZE, EnergyLedger, FloatArray
from cable_fem_node.rod.rod_records import ANGLE, EYE_X, STRETCH, TENSION
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.machine.readings import AxisReading, GuidePlace
from winding_core.markers import MarkerFlag, Markers, wound_markers

NODE_DTYPE = np.dtype(
    [(name, "<f8") for name in ("x", "y", "z", "s", "tension", "strain", "roll", "twist")]
)
# Laid nodes behind the edge whose mean curvature is the cylinder's: the edge's own push has
# decayed over the two that are left out.
_LAID = slice(-7, -2)
_FREE = 4  # Free nodes that the bending moment is followed over


class WindingModel(ABC):
    """A cable between the turning cylinder and the guide, advanced along the machine's motion."""

    step_limit: float  # Longest step of integration [s]

    def __init__(self, config: WindingConfig) -> None:
        self.config = config
        self.time = 0.0  # [s]
        self.element_steps = 0  # Elements times steps so far
        self._initial_energy = 0.0
        self._ledger = np.zeros(LEDGER_SIZE)
        # Both ends of an advance; the model stands at the second one.
        self._motion = np.zeros((9, 2))
        self._drive[TENSION] = config.resolved.tension
        self._drive[STRETCH:EYE_X] = self._response(config.resolved.tension)
        self._drive[EYE_X:] = self._contact_line, -config.free_length

    def advance_to(self, t: float, reading: AxisReading, tension: float | None = None) -> None:
        """Advance to a time at which the machine stands and moves as read.

        In between, angle and guide follow the cubic through both ends' positions and speeds,
        the tension and the guide's place across the axis a straight line. With the first reading
        the span begins where the guide stands.

        Args:
            t: Time [s], not before the model's own.
            reading: Both axes at that time.
            tension: Measured span tension [N]; None takes the configured tension law.

        Raises:
            ValueError: Time runs backwards, a number is not finite, or the guide does not stand
                outside the wound cable.
            DivergenceError: The integration failed; names time, element and cause.
        """
        angle = reading.cylinder_angle
        inputs = (t, angle, reading.angular_speed, reading.carriage_position, reading.feed_speed)
        if not all(map(math.isfinite, inputs)):
            raise ValueError(f"drive must be finite, got {inputs}")
        span, guide = t - self.time, reading.guide
        if span < 0.0:
            raise ValueError(f"time must not run backwards: at {self.time} s, asked for {t} s")
        if guide is not None:
            guide.free_length(self._contact_line)
            if self.element_steps == 0:
                self._drive[EYE_X:] = guide.x, guide.y
                self._begin_at(guide)
        if span == 0.0:
            return
        case = self.config.case
        if tension is None:
            wound = self.config.resolved.wound_radius * max(angle, 0.0)
            tension = self.config.tension_law(case.weight, case.cylinder_diameter, wound)
        elif not (math.isfinite(tension) and tension >= 0.0):
            raise ValueError(f"tension must not be negative, got {tension} N")
        motion = self._motion
        responses = self._response(tension) if tension != motion[TENSION, 1] else None
        motion[:, 0] = motion[:, 1]
        motion[:STRETCH, 1] = (*inputs[1:], tension)
        if responses is not None:
            motion[STRETCH:EYE_X, 1] = responses
        if guide is not None:
            motion[EYE_X:, 1] = guide.x, guide.y
        self._run(t, span, motion)
        self.time = t

    def compile(self) -> None:
        """Load or build the machine code of the kernels, so that the first advance is not late."""
        model = copy.deepcopy(self)
        still = AxisReading(
            cylinder_angle=0.0, angular_speed=0.0, carriage_position=0.0, feed_speed=0.0
        )
        model.advance_to(model.step_limit, still)
        _ = model.energy

    @property
    def _drive(self) -> FloatArray:
        """The end of the last advance, shape (9,), rows ANGLE .. EYE_Y, as a view."""
        return self._motion[:, 1]

    @property
    def cylinder_angle(self) -> float:
        """Theta of the cylinder [rad]."""
        return float(self._drive[ANGLE])

    @property
    def span_tension(self) -> float:
        """Tension of the span [N]."""
        return float(self._drive[TENSION])

    @property
    @abstractmethod
    def energy(self) -> EnergyLedger:
        """The energy ledger since the start."""

    @abstractmethod
    def markers(self) -> Markers:
        """Return the records of P0..Pn; those not yet on the cylinder carry NOT_WOUND."""

    @abstractmethod
    def cable(self) -> NDArray[np.void]:
        """Return records of NODE_DTYPE from P0 on.

        x y z [m], s [m] (reference), tension [N], strain; roll [rad] about the cable's axis, from
        the surface's normal; twist [rad/m] of the sections, the helix's own included. Tension,
        strain and twist of a record are those of the element towards P0 (of P0: its own). Roll and
        twist turn right-handed about the direction away from P0.
        """

    @abstractmethod
    def wound_path(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (s reference arc length [m], theta [rad], z [m]) of the laid cable from P0 on."""

    @abstractmethod
    def wound_stretch(self) -> float:
        """Return the mean stretch of the laid cable; of the first element before any is laid."""

    @abstractmethod
    def newest_cable(self, turns: float) -> NDArray[np.void]:
        """Return `cable` up to the guide: its last turns on the cylinder, all that moves, the span.

        What it leaves out lies still on the cylinder.

        Args:
            turns: Count of turns, from where the cable lands.
        """

    def lift_off(self) -> float:
        """Return the azimuth [rad] at which the cable leaves the cylinder, see `lift_off_angle`.

        Raises:
            ValueError: It cannot be seen between these elements.
        """
        cable, laid = self.cable(), self.wound_path()[0].size
        return lift_off_angle(np.stack([cable["x"], cable["y"]]), np.diff(cable["s"]), laid)

    @abstractmethod
    def _begin_at(self, guide: GuidePlace) -> None:
        """Begin with a straight span from P0 to the guide."""

    @abstractmethod
    def _response(self, tension: float) -> tuple[float, float]:
        """Return (stretch of the span, radius at which it lands [m]) at a tension [N]."""

    @abstractmethod
    def _run(self, t: float, span: float, drive: FloatArray) -> None:
        """Advance by a span [s] to t, drive (7, 2) from its first to its second column."""

    def _fill_twist(self, records: NDArray[np.void], laid: int) -> None:
        """Fill the twist of records, shape (nodes,), of which the first are laid; roll is there."""
        edges = np.array([np.diff(records[name]) for name in "xyz"])
        own = geodesic_twist(edges / np.linalg.norm(edges, axis=0), self._contact_line)
        own[max(laid - 1, 0) :] = 0.0
        records["twist"][1:] = np.diff(records["roll"]) / np.diff(records["s"]) + own
        records["twist"][0] = records["twist"][1]

    @property
    def _contact_line(self) -> float:
        return self.config.resolved.constants.contact_line

    def _place_loose(self, records: Markers, arc: FloatArray, nodes: FloatArray) -> None:
        """Place the markers that are not on the cylinder on nodes (3, n) [m] at arc (n,) [m]."""
        loose = (records["flags"] & int(MarkerFlag.NOT_WOUND)) > 0
        place = records["id"][loose] * self.config.case.marker_spacing
        for name, values in zip("xyz", nodes, strict=True):
            records[name][loose] = np.interp(place, arc, values)

    def _marker_records(
        self,
        arc: FloatArray,
        theta: FloatArray,
        z: FloatArray,
        wound_to: float,
        raised: FloatArray | None = None,
    ) -> Markers:
        """Return the records of markers on cable at arc [m], theta [rad], z [m], laid to an arc.

        On layers they stand out as far as the cable is raised there [m].
        """
        case = self.config.case
        ids = np.arange(case.marker_count + 1)
        place = ids * case.marker_spacing
        return wound_markers(
            ids=ids,
            theta=np.interp(place, arc, theta),
            z=np.interp(place, arc, z),
            radius=case.centreline_radius,
            raised=0.0 if raised is None else np.interp(place, arc, raised),
            cylinder_angle=self.cylinder_angle,
            flags=np.where(place > wound_to, int(MarkerFlag.NOT_WOUND), 0),
        )


def geodesic_twist(tangent: FloatArray, radius: float) -> FloatArray:
    """Return how fast the surface's normal turns about cable of directions (3, n) [rad/m]."""
    return np.asarray(-tangent[2] * np.hypot(tangent[0], tangent[1]) / radius)


def angle_steps(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the angles between neighbours of a path (n,), backwards about the origin [rad]."""
    before_x, before_y, x, y = x[:-1], y[:-1], x[1:], y[1:]
    return np.arctan2(x * before_y - before_x * y, before_x * x + before_y * y)


def wound_angles(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the angle wound backwards about the origin along a path (n,) [rad], from zero on."""
    theta = np.zeros(x.size)
    np.cumsum(angle_steps(x, y), out=theta[1:])
    return theta


def lift_off_angle(position: FloatArray, reference: FloatArray, laid: int) -> float:
    """Return the azimuth [rad] at which the free cable's curvature reaches the cylinder's.

    The moment is continuous there and decays along the free cable nearly as an exponential; its
    logarithm over the first free nodes is followed back by a parabola. Nodes land and leave one
    by one, the moment changes steadily.

    Args:
        position: Of the nodes across the cylinder's axis [m], shape (2, n).
        reference: Reference lengths of the elements [m], shape (n - 1,).
        laid: Nodes that lie on the cylinder.

    Raises:
        ValueError: Too little cable lies, or elements are too long to see it bend off the cylinder.
    """
    if not 8 <= laid <= position.shape[1] - _FREE - 1:
        raise ValueError(
            f"lift-off needs 8 nodes on the cylinder and {_FREE + 1} off it, got {laid} of "
            f"{position.shape[1]}"
        )
    edge = np.diff(position, axis=1)
    turning = np.arctan2(
        edge[0, :-1] * edge[1, 1:] - edge[1, :-1] * edge[0, 1:],
        (edge[:, :-1] * edge[:, 1:]).sum(axis=0),
    )
    curvature = np.abs(2.0 * turning / (reference[:-1] + reference[1:]))
    # Entry i belongs to node i + 1: the last laid node is entry laid - 2.
    on_cylinder = float(curvature[: laid - 1][_LAID].mean())
    free = slice(laid - 1, laid - 1 + _FREE)
    share = curvature[free] / on_cylinder
    if not (np.all(np.diff(share) < 0.0) and share[-1] > 0.05):
        raise ValueError(
            f"over the first {_FREE} elements off the cylinder the curvature falls to "
            f"{share[-1]:.2g} of the cylinder's (limit 0.05): take shorter elements"
        )
    azimuth = np.arctan2(position[1], position[0])[laid : laid + _FREE]
    return float(np.polyval(np.polyfit(np.log(share), azimuth, 2), 0.0))
