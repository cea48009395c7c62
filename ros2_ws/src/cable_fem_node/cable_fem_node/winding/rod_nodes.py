"""The rod's nodes in two parts: those that rest on the cylinder, and those that are integrated."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.state import BELOW_ROWS, GONE, FloatArray, Points, empty_points
from cable_fem_node.rod.relaxation import branches_energy
from cable_fem_node.rod.rod_kernels import bending_energy, stored_energy
from cable_fem_node.rod.rod_records import (
    REFERENCE,
    STATE_ROWS,
    TIE_ALONG,
    TIE_PLACE,
    TIE_WATCHED,
    VISCOUS,
    RodState,
)
from cable_fem_node.winding import resting_cable
from cable_fem_node.winding.resolved_model import ResolvedModel
from cable_fem_node.winding.resting_cable import Fading, RestingCable, turned
from cable_fem_node.winding.winding_kernels import points_of
from cable_fem_node.winding.winding_model import geodesic_twist
from cable_fem_node.winding.wound_surface import CableBelow
from winding_core.cable.material_law import TABLE_HIGH, TABLE_LOW


@dataclass(frozen=True, kw_only=True)
class WholeRod:
    """All nodes and elements of a rod, resting or not."""

    cable: Points  # The nodes
    reference: FloatArray  # Lengths of the elements [m], shape (nodes,)
    # Elastic and viscous forces of the elements [N]; no rows for an elastic cable.
    viscous: FloatArray
    angle: float  # Of the cylinder [rad], whose surface clamps the cable at P0

    def stored(self, resolved: ResolvedModel) -> float:
        """Return what stretching, bending and torsion store [J]; the last element is fed."""
        k, axial = resolved.constants, resolved.axial
        cable, reference = self.cable, self.reference
        elements = cable.touching.size - 2
        stretching = stored_energy(elements, cable.position, reference, axial)
        edges = np.diff(cable.position, axis=1)
        lengths = np.sqrt((edges**2).sum(axis=0))
        if self.viscous.size:
            stretch = lengths[:elements] / reference[:elements]
            stretching += branches_energy(
                stretch, reference, self.viscous, axial, resolved.relaxation
            )
        tangents = edges / lengths
        cosine = np.ones(elements + 2)
        cosine[1:-1] = (tangents[:, 1:] * tangents[:, :-1]).sum(axis=0)
        clamp = math.sin(self.angle) * tangents[0, 0] - math.cos(self.angle) * tangents[1, 0]
        turned_by = math.acos(min(1.0, clamp)) ** 2
        clamped = k.bending * turned_by / float(reference[0])
        bending = bending_energy(elements + 1, reference, k.bending, cosine) + clamped
        twisting = 0.0
        if k.rolling:
            wound = (cable.touching[:-1] == 1) & (cable.touching[1:] == 1)
            own = geodesic_twist(tangents, k.contact_line)
            twist = np.diff(cable.roll[0]) / k.segment + np.where(wound, own, 0.0)
            twisting = 0.5 * k.torsion * k.segment * float((twist[:-1] ** 2).sum())
        return stretching + bending + twisting


def kinetic_energy(cable: Points, resolved: ResolvedModel, end: int) -> float:
    """Return the kinetic energy [J] of nodes 1 to `end` - 1."""
    k, moving = resolved.constants, slice(1, end)
    return 0.5 * k.mass * float((cable.velocity[:, moving] ** 2).sum()) + (
        0.5 * k.roll_inertia * float((cable.roll[1, moving] ** 2).sum())
    )


# The integrated node whose motion over the surface wakes the cable before it: far
# enough from the tie that the tie does not hold it, and that what comes is seen before it arrives.
WATCHED = 4


class RodNodes:
    """Nodes from P0 to the guide; the border between both parts moves.

    Args:
        position: Of all nodes [m], shape (3, n); only P0 rests.
        reference: Reference lengths of the elements [m], shape (n - 1,).
        fading: How held cable fades; None for an elastic cable.
        elastic: Force that the law carries in every element at the start [N].

    Attributes:
        live: Number of integrated nodes; the first one is the last of those that rest.
        state: Of the integrated nodes and elements, as the kernel takes it.
        touching: Which integrated nodes are in contact, as the kernel takes it.
        below: Cable that integrated nodes may lie on, see `Points`.
        room: In which they may lie on no other, see `RodState`.
        way: Over the surface, the same [m].
        resting: The nodes that turn with the cylinder.
        tie: How the cylinder holds the first integrated node, rows TIE_PLACE .. TIE_WATCHED.
        tie_length: Reference length that bends about that node, twice the mean of both sides [m].
    """

    def __init__(
        self,
        position: FloatArray,
        reference: FloatArray,
        fading: Fading | None = None,
        elastic: float = 0.0,
    ) -> None:
        self.live = int(position.shape[1])
        more = 0 if fading is None else fading.rows
        self.state = np.zeros((STATE_ROWS + more, 2 * self.live + 64))
        self.state[VISCOUS : VISCOUS + 1, : reference.size] = elastic
        self.touching = np.zeros(2 * self.live + 64, dtype=np.int64)
        self.below = np.zeros((0, self.touching.size))
        self.room = np.zeros((0, self.touching.size))
        self.way = 0.0
        self.points.position[:, : self.live] = position
        self.reference[: reference.size] = reference
        self.resting = RestingCable(float(position[0, 0]), fading)
        self.tie = np.zeros((3, 3))
        self._hold(0.0)

    @property
    def points(self) -> Points:
        """State of the integrated nodes, as views."""
        return points_of(self.state, self.touching, self.below)

    @property
    def rod(self) -> RodState:
        """The integrated nodes as the kernel takes them; none is watched where P0 alone rests."""
        watched = WATCHED if self.resting.count > 1 else 0
        return RodState(
            nodes=self.live,
            rows=self.state,
            touching=self.touching,
            below=self.below,
            room=self.room,
            way=self.way,
            tie=self.tie,
            tie_length=self.tie_length,
            watched=watched,
        )

    @property
    def reference(self) -> FloatArray:
        """Reference lengths of the integrated elements [m], as a view."""
        return np.asarray(self.state[REFERENCE])

    @property
    def viscous(self) -> FloatArray:
        """Elastic and viscous forces of the integrated elements [N], as a view; rows as VISCOUS."""
        return np.asarray(self.state[VISCOUS:])

    @property
    def total(self) -> int:
        """Number of nodes."""
        return self.resting.count - 1 + self.live

    @property
    def position(self) -> FloatArray:
        """Where the integrated nodes are [m], shape (3, live)."""
        return self.state[0:3, : self.live]

    def live_stretch(self) -> FloatArray:
        """Return the stretch of the integrated elements, shape (live - 1,)."""
        edges = np.diff(self.position, axis=1)
        return np.asarray(np.sqrt((edges**2).sum(axis=0)) / self.reference[: self.live - 1])

    def beyond_tables(self) -> NDArray[np.bool_]:
        """Return which integrated elements the law's tables do not reach, the span's last never."""
        stretch = self.live_stretch()[:-1]
        return ~((stretch > TABLE_LOW) & (stretch < TABLE_HIGH))

    def laid(self) -> int:
        """Return how many integrated nodes are laid on the cylinder; the first always is."""
        touching = np.flatnonzero(self.touching[: self.live])
        return int(touching[-1]) + 1 if touching.size else 1

    def place(self, nodes: int, angle: float) -> FloatArray:
        """Return x, y, z [m] of the first integrated nodes in the frame of the cylinder."""
        x, y, z = self.state[0:3, :nodes]
        return np.stack([*turned(-angle, x, y), z])

    def roll(self, begin: int = 0) -> FloatArray:
        """Return the roll angle of the nodes from a resting one on [rad], shape (total - begin,).

        The guide lets the cable spin.
        """
        resting = self.resting.row(resting_cable.ROLL)[begin:-1]
        live = self.points.roll[0, : self.live - 1]
        return np.concatenate([resting, live, live[-1:]])

    def path(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (s [m], theta [rad], z [m]) of all nodes, as views that the next call changes."""
        return self.resting.path(self.reference[: self.live - 1], self.position)

    def look(self, found: CableBelow, landing: float) -> None:
        """Take over what cable the integrated nodes may lie on, and until when.

        Args:
            found: The cable.
            landing: Radius at which free nodes land [m].
        """
        if found.below.size:
            free = slice(1, self.live)
            radius = self.points.contact_radius[free]
            radius[self.touching[free] == 0] = landing
        self.way = found.way
        self.below, self.room = (
            np.zeros((part.shape[0], self.touching.size)) for part in found[:2]
        )
        self.room[1], self.room[2] = -math.inf, math.inf
        self.below[:, : self.live], self.room[:, : self.live] = found.below, found.room

    def rest(self, nodes: int, angle: float) -> None:
        """Lay the first integrated nodes to rest.

        Args:
            nodes: How many; the last of them becomes the first that is integrated.
            angle: Of the cylinder [rad].
        """
        self.resting.add(nodes, angle, self.points, self.reference, self.viscous)
        left = self.live - nodes
        for values in (self.state, self.touching, self.below, self.room):
            values[..., :left] = values[..., nodes : self.live]
        self.live = left
        self._hold(angle)

    def wake(self, nodes: int, angle: float, back: float, dt: float) -> None:
        """Integrate the last resting nodes again, in the state that they were laid to rest with.

        Args:
            nodes: How many.
            angle: Of the cylinder [rad].
            back: By how much it turned in the last step [rad].
            dt: Length of that step [s].
        """
        longer = self.live + nodes
        if longer > self.touching.size:
            self.grow(2 * longer)
        for values in (self.state, self.touching, self.below):
            values[..., nodes:longer] = values[..., : self.live].copy()
        self.below[:, :nodes] = 0.0
        self.resting.put(nodes, angle, back, dt, self.points, self.reference, self.viscous)
        self.resting.let_go(nodes)
        self.live = longer
        self._hold(angle)

    def grow(self, capacity: int) -> None:
        """Make room for so many integrated nodes."""
        state = np.zeros((self.state.shape[0], capacity))
        touching = np.zeros(capacity, dtype=np.int64)
        used = self.touching.size
        state[:, :used], touching[:used] = self.state, self.touching
        self.state, self.touching = state, touching
        below = np.zeros((self.below.shape[0], capacity))
        below[:, :used] = self.below
        self.below = below
        self.room = np.zeros((0, capacity))

    def whole(self, angle: float, back: float, dt: float) -> WholeRod:
        """Return the state of all nodes and elements.

        Args:
            angle: Of the cylinder [rad].
            back: By how much it turned in the last step [rad].
            dt: Length of that step [s].
        """
        points, reference = empty_points(self.total), np.zeros(self.total)
        viscous = np.zeros((self.viscous.shape[0], self.total))
        first = self.resting.count - 1
        points = points._replace(below=np.zeros((self.below.shape[0], self.total)))
        self.resting.put(first, angle, back, dt, points, reference, viscous)
        for all_nodes, integrated in zip(points, self.points, strict=True):
            all_nodes[..., first:] = integrated[..., : self.live]
        elements = points.below[5:GONE:BELOW_ROWS]
        elements[elements > 0.0] += first
        reference[first:] = self.reference[: self.live]
        viscous[:, first:] = self.viscous[:, : self.live]
        return WholeRod(cable=points, reference=reference, viscous=viscous, angle=angle)

    def _hold(self, angle: float) -> None:
        """Tie the first integrated node to the cylinder as it is, at an angle [rad]."""
        self.tie[TIE_PLACE] = self.resting.place()[:, -1]
        self.tie[TIE_ALONG] = self.resting.along()
        self.tie[TIE_WATCHED] = self.place(WATCHED + 1, angle)[:, -1]
        self.tie_length = float(self.reference[0] + self.resting.row(resting_cable.REFERENCE)[-1])
