"""What the benchmark knows of the solver's kernel: a rod's state, and a call that advances it.

Whoever changes the kernel's arguments changes this file; the floor in C takes the same state.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.state import LEDGER_SIZE, Points
from cable_fem_node.rod.rod_records import (
    REFERENCE,
    RUNNING,
    Advance,
    AxialResponse,
    Constants,
    Relaxation,
)
from cable_fem_node.rod.rod_records import RodState as KernelState
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.winding_kernels import advance_winding, points_of
from cable_fem_node.winding.winding_model import wound_angles
from winding_core.machine.drive import DriveProfile

FloatArray = NDArray[np.float64]


@dataclass(kw_only=True)
class RodState:
    """A rod of which P0 alone rests, to be advanced more than once from the same state.

    Attributes:
        nodes: In use.
        surface_step: The cylinder's rotation in the step before [rad].
        state: Of nodes and elements, rows as in `points_of`, shape (rows, capacity).
        touching: 1 where a node is in contact, shape (capacity,).
        tie: How the cylinder holds P0.
        tie_length: Reference length that bends about P0 [m].
        ledger: Energies [J].
        constants: Of the run.
        response: Axial response of the cable.
        relax: How its stress fades: not at all.
    """

    nodes: int
    surface_step: float
    state: FloatArray
    touching: NDArray[np.int64]
    tie: FloatArray
    tie_length: float
    ledger: FloatArray
    constants: Constants
    response: AxialResponse
    relax: Relaxation

    @classmethod
    def of(cls, model: RodWinding, capacity: int) -> RodState:
        """Copy the state of a model into arrays of a capacity."""
        nodes = model._nodes
        assert nodes.live == nodes.total, "turns rest already: wind with rests=False"
        state = np.zeros((nodes.state.shape[0], capacity))
        touching = np.zeros(capacity, dtype=np.int64)
        state[:, : nodes.live] = nodes.state[:, : nodes.live]
        touching[: nodes.live] = nodes.touching[: nodes.live]
        return cls(
            nodes=nodes.live,
            surface_step=model._surface_rate * model._last_step,
            state=state,
            touching=touching,
            tie=nodes.tie.copy(),
            tie_length=nodes.tie_length,
            ledger=np.zeros(LEDGER_SIZE),
            constants=model._constants,
            response=model.config.resolved.axial,
            relax=model.config.resolved.relaxation,
        )

    @property
    def kernel_state(self) -> KernelState:
        """The nodes and elements as the kernel takes them."""
        none = np.zeros((0, self.touching.size))
        return KernelState(
            nodes=self.nodes,
            rows=self.state,
            touching=self.touching,
            below=none,
            room=none,
            way=math.inf,
            tie=self.tie,
            tie_length=self.tie_length,
            watched=0,
        )

    @property
    def cable(self) -> Points:
        """The nodes, as views."""
        return points_of(self.state, self.touching, np.zeros((0, self.touching.size)))

    @property
    def reference(self) -> FloatArray:
        """Reference lengths [m], as a view."""
        return np.asarray(self.state[REFERENCE])

    def copy(self) -> RodState:
        """Return a state of its own."""
        return dataclasses.replace(
            self,
            state=self.state.copy(),
            touching=self.touching.copy(),
            ledger=self.ledger.copy(),
        )

    def theta(self) -> FloatArray:
        """Return the wound angle of every node [rad]."""
        return wound_angles(*self.cable.position[:2, : self.nodes])


def drive_between(model: RodWinding, profile: DriveProfile, span: float) -> FloatArray:
    """Return what the machine does during a span [s] from the model's time on, shape (7, 2)."""
    drive = np.stack([model._drive, model._drive], axis=1)
    reading = profile.reading_at(model.time + span)
    drive[:4, 1] = (
        reading.cylinder_angle,
        reading.angular_speed,
        reading.carriage_position,
        reading.feed_speed,
    )
    return drive


def kernel_advance(state: RodState, drive: FloatArray, steps: int, dt: float) -> None:
    """Advance a state in place by steps of dt [s] with the kernel of the solver."""
    end = Advance(
        *advance_winding(
            state.kernel_state,
            steps,
            dt,
            dt,
            state.surface_step / dt,
            drive,
            state.constants,
            state.response,
            state.relax,
            state.ledger,
        )
    )
    assert (end.steps, end.status) == (steps, RUNNING)
    state.nodes, state.surface_step = end.nodes, end.surface_rate * dt
