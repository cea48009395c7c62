"""Cable that lies still on the cylinder: its nodes in the cylinder's frame, not integrated."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cable_fem_node.dynamics.state import FloatArray, Points
from cable_fem_node.rod.relaxation import branches_energy
from cable_fem_node.rod.rod_records import AxialResponse, Relaxation
from cable_fem_node.winding.resolved_model import ResolvedModel
from cable_fem_node.winding.winding_model import angle_steps

# Rows of the store; the reference length is that of the element towards P0. What follows from
# them is not kept: a node at rest touches, and its stretch is the length over the reference.
X, Y, Z, SLIP, SLIP_Z, CONTACT_RADIUS, ROLL, REFERENCE, ARC, THETA = range(10)
_ROWS = 10
_VISCOUS = _ROWS  # Where the cable relaxes, elastic force and viscous forces of the element follow
# Room is made for a fifth more, so that a node takes 96 bytes at most, unused room included.
_GROWTH = 1.2
_FEWEST = 64
PATH = (ARC, THETA, Z)
# How a node is held where it rests: the rows that go into the arrays that are integrated.
_PLACE = slice(X, Z + 1)
_SLIPS = slice(SLIP, SLIP_Z + 1)


@dataclass(frozen=True, kw_only=True)
class HeldCable:
    """Elements that friction holds on the cylinder, as views into their arrays."""

    stretch: FloatArray  # Of the elements, shape (n,)
    reference: FloatArray  # Their lengths [m], shape (n,)
    viscous: FloatArray  # Elastic force and every branch's q [N], shape (1 + terms, n), changed
    radius: FloatArray  # Of the node behind each element [m], shape (n,)
    contact_radius: FloatArray  # At which that node touches [m], shape (n,), changed


@dataclass(frozen=True, kw_only=True)
class Fading:
    """How held cable fades."""

    relax: Relaxation  # Of the cable
    response: AxialResponse  # Its axial response
    sink: float  # How much deeper a node lies for each newton of tension and metre of length [1/N]
    stiffness: float  # Of the penalty spring that it lies on [N/m]

    @classmethod
    def of(cls, resolved: ResolvedModel) -> Fading:
        """Return how a model's cable fades."""
        k = resolved.constants
        return cls(
            relax=resolved.relaxation,
            response=resolved.axial,
            sink=1.0 / (k.contact_line * k.touch.normal_stiffness),
            stiffness=k.touch.normal_stiffness,
        )

    @property
    def rows(self) -> int:
        """Count of an element's rows: its elastic force, and every branch's q."""
        return 1 + self.relax.share.size

    def viscous(self, span: float, rows: FloatArray) -> FloatArray:
        """Return every branch's q after a time [s] at a held stretch [N], shape (terms, n).

        Args:
            span: The time [s].
            rows: As `HeldCable.viscous` [N], shape (1 + terms, n).
        """
        full = self.relax.share[:, None] * rows[0]
        left = np.exp(-span / self.relax.time)[:, None]
        return np.asarray(full + left * (rows[1:] - full))

    def fade(self, span: float, cable: HeldCable) -> float:
        """Let a time [s] pass; return the energy that has become heat [J].

        Nodes stay where they are: the spring below them is shortened as their tension fades.
        """
        before = self._energy(cable)
        branches = cable.viscous[1:]
        later = self.viscous(span, cable.viscous)
        change = (later - branches).sum(axis=0)
        branches[:] = later
        depth = cable.contact_radius - cable.radius
        # Cable that lies on cable does not press on the cylinder.
        less = self.sink * change * cable.stretch * cable.reference * (depth > 0.0)
        cable.contact_radius[:] -= less
        pressed = 0.5 * self.stiffness * float(((2.0 * depth - less) * less).sum())
        return before - self._energy(cable) + pressed

    def _energy(self, cable: HeldCable) -> float:
        return float(
            branches_energy(
                cable.stretch, cable.reference, cable.viscous, self.response, self.relax
            )
        )


def turned(angle: float, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return x and y turned about the cylinder's axis by an angle [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    return c * x - s * y, s * x + c * y


class RestingCable:
    """Nodes from P0 on that turn with the cylinder as if they were part of it.

    P0 always is among them. The last one is the node that the integrated cable begins with.

    Args:
        radius: Of P0 [m].
        fading: How its tension fades; None for an elastic cable.
    """

    def __init__(self, radius: float, fading: Fading | None = None) -> None:
        self.count = 1
        self._fading = fading
        self._faded_to = 0.0
        more = 0 if fading is None else fading.rows
        self._rows = np.zeros((_ROWS + more, _FEWEST))
        self._rows[X, 0] = radius

    @property
    def bytes(self) -> int:
        """Memory that the nodes take [B], unused room included."""
        return self._rows.nbytes

    def row(self, name: int) -> FloatArray:
        """Return a row, one value per resting node, shape (count,)."""
        return self._rows[name, : self.count]

    def place(self) -> FloatArray:
        """Return x, y, z [m] in the frame of the cylinder, shape (3, count)."""
        return self._rows[_PLACE, : self.count]

    def along(self) -> FloatArray:
        """Return the direction of the cable at the last node (3,), in the frame of the cylinder.

        P0 holds the cable along the circumference, every other node along the element before it.
        """
        if self.count == 1:
            return np.array([0.0, -1.0, 0.0])
        edge = self._rows[_PLACE, self.count - 1] - self._rows[_PLACE, self.count - 2]
        return np.asarray(edge / math.sqrt(float(edge @ edge)))

    def stretch(self, begin: int = 0) -> FloatArray:
        """Return the stretch of the elements from a node on, shape (count - 1 - begin,)."""
        edges = np.diff(self._rows[_PLACE, begin : self.count], axis=1)
        reference = self._rows[REFERENCE, begin + 1 : self.count]
        return np.asarray(np.sqrt((edges**2).sum(axis=0)) / reference)

    def fade(self, t: float) -> float:
        """Let the tension fade until a time [s]; return the energy that has become heat [J].

        Friction holds the cable at its length, so nothing moves.
        """
        span, self._faded_to = t - self._faded_to, t
        if self._fading is None or self.count == 1 or not span > 0.0:
            return 0.0
        rows = self._rows[:, 1 : self.count]
        return self._fading.fade(
            span,
            HeldCable(
                stretch=self.stretch(),
                reference=rows[REFERENCE],
                viscous=rows[_VISCOUS:],
                radius=np.hypot(rows[X], rows[Y]),
                contact_radius=rows[CONTACT_RADIUS],
            ),
        )

    def faded(self, t: float, begin: int = 0) -> FloatArray:
        """Return what the tension has faded by at a time [s], not before the last `fade` [N].

        Args:
            t: When [s].
            begin: Count of the elements that are left out, from P0 on.
        """
        elements = self._rows[_VISCOUS:, begin + 1 : self.count]
        if self._fading is None:
            return np.zeros(elements.shape[1])
        return np.asarray(self._fading.viscous(t - self._faded_to, elements).sum(axis=0))

    def add(
        self,
        nodes: int,
        angle: float,
        cable: Points,
        reference: FloatArray,
        viscous: FloatArray | None = None,
    ) -> None:
        """Lay nodes 1 to `nodes` of the integrated cable to rest.

        Args:
            nodes: How many.
            angle: Of the cylinder [rad].
            cable: Integrated nodes, touching the cylinder; node 0 rests already.
            reference: Reference lengths of its elements [m], shape (at least nodes,).
            viscous: Elastic and viscous forces of its elements [N]; none of an elastic cable.
        """
        old, new = self.count, self.count + nodes
        self._reserve(new)
        moved, elements = slice(1, nodes + 1), slice(0, nodes)
        rows = self._rows[:, old:new]
        rows[X], rows[Y] = turned(-angle, cable.position[0, moved], cable.position[1, moved])
        rows[Z] = cable.position[2, moved]
        rows[_SLIPS] = cable.slip[:, moved]
        rows[CONTACT_RADIUS] = cable.contact_radius[moved]
        rows[ROLL] = cable.roll[0, moved]
        rows[REFERENCE] = reference[elements]
        if viscous is not None:
            rows[_VISCOUS:] = viscous[:, elements]
        self.count = new
        self._continue(old, reference[elements], cable.position[:2, : nodes + 1])

    def put(
        self,
        nodes: int,
        angle: float,
        back: float,
        dt: float,
        cable: Points,
        reference: FloatArray,
        viscous: FloatArray,
    ) -> None:
        """Write the last nodes as they are now, moving as the surface does.

        Args:
            nodes: How many elements; columns 0 to `nodes` are filled.
            angle: Of the cylinder [rad].
            back: By how much it turned in the last step [rad].
            dt: Length of that step [s].
            cable: Filled.
            reference: Filled with the lengths of the elements [m].
            viscous: Filled with their elastic and viscous forces [N]; no rows for an elastic cable.
        """
        rows = self._rows[:, self.count - nodes - 1 : self.count]
        to = slice(0, nodes + 1)
        x, y = turned(angle, rows[X], rows[Y])
        before_x, before_y = turned(-back, x, y)
        cable.position[0, to], cable.position[1, to] = x, y
        cable.position[2, to] = rows[Z]
        cable.velocity[0, to], cable.velocity[1, to] = (x - before_x) / dt, (y - before_y) / dt
        cable.velocity[2, to] = 0.0
        cable.slip[:, to] = rows[_SLIPS]
        cable.contact_radius[to] = rows[CONTACT_RADIUS]
        # P0 is held by its clamp, all others by the surface.
        cable.touching[to] = 1
        if nodes == self.count - 1:
            cable.touching[0] = 0
        cable.roll[0, to] = rows[ROLL]
        cable.roll[1, to] = 0.0
        reference[:nodes] = rows[REFERENCE, 1:]
        viscous[:, :nodes] = rows[_VISCOUS:, 1:]

    def let_go(self, nodes: int) -> None:
        """Count the last nodes no longer as resting."""
        self.count -= nodes

    def path(
        self, reference: FloatArray, position: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (s [m], theta [rad], z [m]) of the resting and the integrated nodes.

        The cost does not grow with what rests. The arrays are views that the next call changes.

        Args:
            reference: Reference lengths of the integrated elements [m], shape (n - 1,).
            position: Of the integrated nodes, shape (3, n); node 0 is the last that rests.
        """
        end = self.count - 1 + position.shape[1]
        self._reserve(end)
        self._continue(self.count, reference, position[:2])
        self._rows[Z, self.count : end] = position[2, 1:]
        return self._rows[ARC, :end], self._rows[THETA, :end], self._rows[Z, :end]

    def _continue(self, begin: int, reference: FloatArray, position: FloatArray) -> None:
        """Fill arc and angle from a column on; position (2, n) begins with the node before it."""
        columns = slice(begin, begin + reference.size)
        for row, steps in ((ARC, reference), (THETA, angle_steps(*position))):
            filled = self._rows[row, columns]
            filled[:] = steps
            # One sum from P0 on, so that an arc is the same to the last bit wherever the border is.
            filled[0] += self._rows[row, begin - 1]
            filled.cumsum(out=filled)

    def _reserve(self, capacity: int) -> None:
        if capacity > self._rows.shape[1]:
            room = max(_FEWEST, math.ceil(_GROWTH * capacity))
            grown = np.zeros((self._rows.shape[0], room))
            grown[:, : self.count] = self._rows[:, : self.count]
            self._rows = grown
