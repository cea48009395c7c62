"""What the benchmark knows of the solver's kernel: a rod's state, and a call that advances it.

Whoever changes the kernel's arguments changes this file; the floor in C takes the same state.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.points import LEDGER_SIZE, Points
from cable_fem_node.rod.rod_arrays import AxialResponse, empty_work
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.winding_kernels import advance_winding
from cable_fem_node.winding.winding_model import wound_angles
from cable_fem_node.winding.winding_state import RUNNING, Constants
from winding_core.drive import DriveProfile

FloatArray = NDArray[np.float64]


@dataclass(kw_only=True)
class RodState:
    """A rod that can be advanced more than once from the same state.

    Attributes:
        nodes: In use.
        surface_step: The cylinder's rotation in the step before [rad].
        cable: Arrays of the nodes.
        reference: Reference lengths [m], shape (capacity,).
        ledger: Energies [J].
        constants: Of the run.
        response: Axial response of the cable.
    """

    nodes: int
    surface_step: float
    cable: Points
    reference: FloatArray
    ledger: FloatArray
    constants: Constants
    response: AxialResponse

    @classmethod
    def of(cls, model: RodWinding, capacity: int) -> RodState:
        """Copy the state of a model into arrays of a capacity."""
        nodes = model.nodes

        def room(array: NDArray[np.generic]) -> NDArray[np.generic]:
            new = np.zeros((*array.shape[:-1], capacity), array.dtype)
            new[..., :nodes] = array[..., :nodes]
            return new

        return cls(
            nodes=nodes,
            surface_step=model._surface_step,
            cable=Points(*map(room, model._cable)),
            reference=room(model._reference),
            ledger=np.zeros(LEDGER_SIZE),
            constants=model._constants,
            response=model.config.resolved.axial,
        )

    def copy(self) -> RodState:
        """Return a state of its own."""
        return RodState(
            nodes=self.nodes,
            surface_step=self.surface_step,
            cable=Points(*(array.copy() for array in self.cable)),
            reference=self.reference.copy(),
            ledger=self.ledger.copy(),
            constants=self.constants,
            response=self.response,
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
    nodes, taken, surface_step, status, _ = advance_winding(
        state.nodes,
        steps,
        dt,
        state.surface_step,
        drive,
        state.cable,
        state.reference,
        empty_work(state.reference.size),
        state.constants,
        state.response,
        state.ledger,
        False,
    )
    assert (taken, status) == (steps, RUNNING)
    state.nodes, state.surface_step = nodes, surface_step
