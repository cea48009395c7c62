"""Live model of a winding run: the rod between the turning cylinder and the guide.

Lab frame: cylinder axis +z, contact line at azimuth zero, the span comes from the -y side in the
plane x = R + r; P0 stands at azimuth Theta, z = 0.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.energy import EnergyLedger, contact_energy
from cable_fem_node.dynamics.failure import DivergenceError
from cable_fem_node.dynamics.points import FloatArray, empty_points
from cable_fem_node.rod.rod_arrays import empty_work
from cable_fem_node.rod.rod_kernels import bending_energy, stored_energy
from cable_fem_node.winding.winding_config import WindingConfig
from cable_fem_node.winding.winding_kernels import advance_winding
from cable_fem_node.winding.winding_model import NODE_DTYPE, WindingModel, wound_angles
from cable_fem_node.winding.winding_state import (
    DIVERGED,
    EMPTY,
    FULL,
    TENSION,
    part_way,
)
from winding_core.markers import MarkerFlag, Markers
from winding_core.material_law import TABLE_HIGH, TABLE_LOW
from winding_core.readings import AxisReading


class RodWinding(WindingModel):
    """The live rod: advanced along the machine's measured or planned motion."""

    def __init__(self, config: WindingConfig) -> None:
        super().__init__(config)
        resolved = config.resolved
        self._constants = resolved.constants
        self.step_limit = resolved.step
        stretch = resolved.stretch
        count = max(3, round(config.free_length / (stretch * config.segment_length)))
        self.nodes = count + 1
        capacity = 2 * count + 64
        self._cable = empty_points(capacity)
        self._reference = np.zeros(capacity)
        self._work = empty_work(capacity)
        cable = self._cable
        along = np.arange(self.nodes) * config.segment_length * stretch
        along[-1] = config.free_length
        cable.position[0, : self.nodes] = self._constants.contact_line
        cable.position[0, 0] = self._constants.start_radius
        cable.position[1, : self.nodes] = -along
        self._reference[: self.nodes - 1] = np.diff(along) / stretch
        self._initial_energy = self._internal_energy()

    def compile(self) -> None:
        """Load or build the machine code of the kernels, so that the first advance is not late."""
        model = RodWinding(self.config)
        still = AxisReading(
            cylinder_angle=0.0, angular_speed=0.0, carriage_position=0.0, feed_speed=0.0
        )
        model.advance_to(model.step_limit, still)
        _ = model.energy

    def markers(self) -> Markers:
        """Return the records of P0..Pn; those not yet on the cylinder carry NOT_WOUND."""
        position = self._cable.position[:, : self.nodes]
        s = self._arc()
        wound_to = float(s[self._laid_nodes() - 1])
        records = self._marker_records(s, self._theta(), position[2], wound_to)
        loose = (records["flags"] & MarkerFlag.NOT_WOUND) > 0
        arc = records["id"][loose] * self.config.case.marker_spacing
        for row, name in enumerate("xyz"):
            records[name][loose] = np.interp(arc, s, position[row])
        return records

    def cable(self) -> NDArray[np.void]:
        """Return the nodes as records of NODE_DTYPE, see `WindingModel.cable`."""
        nodes = self.nodes
        records = np.zeros(nodes, dtype=NODE_DTYPE)
        for row, name in enumerate("xyz"):
            records[name] = self._cable.position[row, :nodes]
        records["s"] = self._arc()
        stretch = self.stretch()
        tension = self.tension()
        records["strain"][1:] = stretch - 1.0
        records["tension"][1:] = tension
        records["strain"][0], records["tension"][0] = stretch[0] - 1.0, tension[0]
        return records

    def stretch(self) -> FloatArray:
        """Return the stretch of every element, shape (nodes - 1,)."""
        edges = np.diff(self._cable.position[:, : self.nodes], axis=1)
        length = np.sqrt((edges**2).sum(axis=0))
        return np.asarray(length / self._reference[: self.nodes - 1])

    def tension(self) -> FloatArray:
        """Return the tension [N] of every element, shape (nodes - 1,)."""
        tension = self.config.case.axial_area * self.config.resolved.law.nominal_stress(
            self.stretch()
        )
        tension[-1] = self._drive[TENSION]
        return tension

    def wound_path(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (s reference arc length [m], theta [rad], z [m]) of the laid nodes from P0 on."""
        laid = self._laid_nodes()
        return self._arc()[:laid], self._theta()[:laid], self._cable.position[2, :laid].copy()

    def wound_stretch(self) -> float:
        """Return the mean stretch of the laid elements; of the first before any is laid."""
        stretch = self.stretch()
        wound = stretch[: self._laid_nodes() - 1]
        return float(wound.mean()) if wound.size else float(stretch[0])

    @property
    def energy(self) -> EnergyLedger:
        """The energy ledger since the start."""
        cable, k = self._cable, self._constants
        moving = slice(1, self.nodes - 1)
        return EnergyLedger.of(
            self._ledger,
            kinetic=0.5 * k.mass * float((cable.velocity[:, moving] ** 2).sum())
            + 0.5 * k.roll_inertia * float((cable.roll[1, moving] ** 2).sum()),
            internal=self._internal_energy() + self._torsion_energy(),
            contact=contact_energy(cable, k.touch, self.nodes),
            initial=self._initial_energy,
        )

    def _run(self, t: float, span: float, drive: FloatArray) -> None:
        total = max(1, math.ceil(span / self.step_limit))
        dt = span / total
        done = 0
        part = drive
        while done < total:
            self.nodes, taken, self._surface_step, status, element = advance_winding(
                self.nodes,
                total - done,
                dt,
                self._surface_step,
                part,
                self._cable,
                self._reference,
                self._work,
                self._constants,
                self.config.resolved.axial,
                self._ledger,
                self.config.rolling,
            )
            done += taken
            self.element_steps += taken * (self.nodes - 1)
            if status == DIVERGED:
                raise DivergenceError(
                    f"the winding diverged before t = {t:.6g} s at element {element} of "
                    f"{self.nodes - 1}: its stretch left {TABLE_LOW:g} to {TABLE_HIGH:g} "
                    f"(step {dt:.3g} s, tension {drive[TENSION, 1]:.4g} N)"
                )
            if status == EMPTY:
                raise DivergenceError(
                    f"the span was pulled back to the cylinder before t = {t:.6g} s: "
                    "no element left"
                )
            if status == FULL:
                self._grow(2 * self.nodes)
                part = part_way(drive, done / total, span)

    def _grow(self, capacity: int) -> None:
        old, reference = self._cable, self._reference
        self._cable = empty_points(capacity)
        self._reference = np.zeros(capacity)
        self._work = empty_work(capacity)
        used = reference.shape[0]
        self._reference[:used] = reference[:capacity]
        for new, kept in zip(self._cable, old, strict=True):
            new[..., :used] = kept[..., :capacity]

    def _response(self, tension: float) -> tuple[float, float]:
        """Return (stretch of the span, radius at which its nodes land [m]) at a tension [N].

        The radius makes up for the chords and for the depth to which the penalty lets the
        wound cable sink.
        """
        resolved = self.config.resolved
        pulls, stretches, radii = resolved.responses
        if not pulls[0] <= tension <= pulls[-1]:
            resolved.stretch_at(tension)
            raise ValueError(f"tension {tension:.4g} N stretches the cable beyond the tables")
        return (
            float(np.interp(tension, pulls, stretches)),
            float(np.interp(tension, pulls, radii)),
        )

    def _internal_energy(self) -> float:
        cable, k = self._cable, self._constants
        elements = self.nodes - 2
        axial = self.config.resolved.axial
        stretching = stored_energy(elements, cable.position, self._reference, axial)
        edges = np.diff(cable.position[:, : self.nodes], axis=1)
        tangents = edges / np.sqrt((edges**2).sum(axis=0))
        cosine = np.ones(self.nodes)
        cosine[1:-1] = (tangents[:, 1:] * tangents[:, :-1]).sum(axis=0)
        angle = self.cylinder_angle
        clamp = math.sin(angle) * tangents[0, 0] - math.cos(angle) * tangents[1, 0]
        turned = math.acos(min(1.0, clamp)) ** 2
        clamped = k.bending * turned / float(self._reference[0])
        return (
            stretching + bending_energy(elements + 1, self._reference, k.bending, cosine) + clamped
        )

    def _torsion_energy(self) -> float:
        if not self.config.rolling:
            return 0.0
        cable, k, nodes = self._cable, self._constants, self.nodes
        edges = np.diff(cable.position[:, :nodes], axis=1)
        tangent = edges / np.sqrt((edges**2).sum(axis=0))
        geodesic = tangent[2] * np.hypot(tangent[0], tangent[1]) / k.contact_line
        wound = (cable.touching[: nodes - 1] == 1) & (cable.touching[1:nodes] == 1)
        twist = np.diff(cable.roll[0, :nodes]) / k.segment - np.where(wound, geodesic, 0.0)
        return 0.5 * k.torsion * k.segment * float((twist[: nodes - 2] ** 2).sum())

    def _arc(self) -> FloatArray:
        s = np.zeros(self.nodes)
        np.cumsum(self._reference[: self.nodes - 1], out=s[1:])
        return s

    def _theta(self) -> FloatArray:
        x, y = self._cable.position[:2, : self.nodes]
        return wound_angles(x, y)

    def _laid_nodes(self) -> int:
        touching = np.flatnonzero(self._cable.touching[: self.nodes])
        return int(touching[-1]) + 1 if touching.size else 1
