"""Live model of a winding run: the rod between the turning cylinder and the guide.

Lab frame: cylinder axis +z, contact line at azimuth zero, the span comes from the -y side in the
plane x = R + r; P0 stands at azimuth Theta, z = 0.
"""

from __future__ import annotations

import math
from dataclasses import fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.energy import EnergyLedger
from cable_fem_node.dynamics.failure import DivergenceError
from cable_fem_node.dynamics.points import (
    LEDGER_SIZE,
    LOSS_CONTACT,
    LOSS_DAMPING,
    LOSS_FRICTION,
    WORK_INFLOW,
    WORK_SPAN,
    WORK_SURFACE,
    WORK_TIE,
    Points,
    empty_points,
)
from cable_fem_node.rod.rod_kernels import bending_energy, stored_energy
from cable_fem_node.winding.winding_config import WindingConfig
from cable_fem_node.winding.winding_kernels import advance_winding
from cable_fem_node.winding.winding_setup import (
    constants_of,
    empty_work,
    part_way,
    responses_of,
    stable_step,
)
from cable_fem_node.winding.winding_state import (
    ANGLE,
    DIVERGED,
    EMPTY,
    FEED,
    FULL,
    GUIDE,
    LANDING,
    SPEED,
    STRETCH,
    TENSION,
)
from winding_core.markers import MarkerFlag, Markers, wound_markers
from winding_core.material_law import TABLE_HIGH, TABLE_LOW

FloatArray = NDArray[np.float64]

NODE_DTYPE = np.dtype([(name, "<f8") for name in ("x", "y", "z", "s", "tension", "strain")])


class RodWinding:
    """The live rod: advanced along the machine's measured or planned motion."""

    def __init__(self, config: WindingConfig) -> None:
        self.config = config
        law = config.uniaxial
        self._law = law
        self._table = law.table()
        self._constants = constants_of(config, law)
        self._responses = responses_of(config, law, self._constants)
        self.step_limit = stable_step(config, law, self._constants)
        pull = config.weight_tension
        stretch = law.stretch_at(pull / config.case.section_area)
        count = max(3, round(config.free_length / (stretch * config.segment_length)))
        self.nodes = count + 1
        capacity = 2 * count + 64
        self._cable = empty_points(capacity)
        self._reference = np.zeros(capacity)
        self._work = empty_work(capacity)
        self.time = 0.0
        self.steps = 0
        self.element_steps = 0
        self._surface_step = 0.0
        self._drive = np.zeros(7)
        self._drive[TENSION], self._drive[STRETCH] = pull, stretch
        self._drive[STRETCH], self._drive[LANDING] = self._response(pull)
        self._ledger = np.zeros(LEDGER_SIZE)
        cable = self._cable
        along = np.minimum(np.arange(self.nodes) * config.segment_length * stretch, np.inf)
        along[-1] = config.free_length
        cable.position[0, : self.nodes] = self._constants.contact_line
        cable.position[0, 0] = self._constants.start_radius
        cable.position[1, : self.nodes] = -along
        self._reference[: self.nodes - 1] = np.diff(along) / stretch
        self._initial_energy = self._internal_energy()

    def advance_to(
        self,
        t: float,
        *,
        cylinder_angle: float,
        angular_speed: float,
        guide_z: float,
        feed_speed: float,
        tension: float | None = None,
    ) -> None:
        """Advance to a time at which the machine stands and moves as given.

        In between, angle and guide follow the cubic through both ends' positions and speeds,
        the tension a straight line.

        Args:
            t: Time [s], not before the model's own.
            cylinder_angle: Theta [rad].
            angular_speed: [rad/s]
            guide_z: z of the guide [m].
            feed_speed: [m/s]
            tension: Measured span tension [N]; None takes the configured tension law.

        Raises:
            ValueError: Time runs backwards or a number is not finite.
            DivergenceError: The integration failed; says when, at which element and why.
        """
        inputs = (t, cylinder_angle, angular_speed, guide_z, feed_speed)
        if not all(map(math.isfinite, inputs)):
            raise ValueError(f"drive must be finite, got {inputs}")
        span = t - self.time
        if span < 0.0:
            raise ValueError(f"time must not run backwards: at {self.time} s, asked for {t} s")
        if span == 0.0:
            return
        case = self.config.case
        if tension is None:
            wound = self._constants.contact_line * max(cylinder_angle, 0.0)
            tension = self.config.tension_law(case.weight, case.cylinder_diameter, wound)
        elif not (math.isfinite(tension) and tension >= 0.0):
            raise ValueError(f"tension must not be negative, got {tension} N")
        stretch, landing = self._response(tension)
        drive = np.empty((7, 2))
        drive[:, 0] = self._drive
        drive[ANGLE, 1], drive[SPEED, 1] = cylinder_angle, angular_speed
        drive[GUIDE, 1], drive[FEED, 1] = guide_z, feed_speed
        drive[TENSION, 1], drive[STRETCH, 1] = tension, stretch
        drive[LANDING, 1] = landing
        self._run(t, span, drive)
        self._drive = drive[:, 1].copy()
        self.time = t

    def compile(self) -> None:
        """Load or build the machine code of the kernels, so that the first advance is not late."""
        model = RodWinding(self.config)
        model.advance_to(
            model.step_limit, cylinder_angle=0.0, angular_speed=0.0, guide_z=0.0, feed_speed=0.0
        )
        _ = model.energy

    def markers(self) -> Markers:
        """Return the records of P0..Pn; those not yet on the cylinder carry NOT_WOUND."""
        case = self.config.case
        nodes = self.nodes
        cable = self._cable
        ids = np.arange(case.marker_count + 1)
        arc = ids * case.marker_spacing
        s = self._arc()
        theta = self._theta()
        laid = self._laid_nodes()
        z = cable.position[2, :nodes]
        marker_theta, marker_z = np.interp(arc, s, theta), np.interp(arc, s, z)
        loose = arc > s[laid - 1]
        records = wound_markers(
            ids=ids,
            theta=marker_theta,
            z=marker_z,
            radius=case.centreline_radius,
            cylinder_angle=float(self._drive[ANGLE]),
            flags=np.where(loose, int(MarkerFlag.NOT_WOUND), 0),
        )
        for name, row in (("x", 0), ("y", 1), ("z", 2)):
            records[name][loose] = np.interp(arc[loose], s, cable.position[row, :nodes])
        return records

    def cable(self) -> NDArray[np.void]:
        """Return the nodes as records x y z [m], s [m] (reference), tension [N], strain.

        Tension and strain of a node are those of the element towards P0 (of P0: its own).
        """
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
        tension = self.config.case.section_area * self._law.nominal_stress(self.stretch())
        tension[-1] = self._drive[TENSION]
        return tension

    def wound_path(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (s reference arc length [m], theta [rad], z [m]) of the laid nodes from P0 on."""
        laid = self._laid_nodes()
        return self._arc()[:laid], self._theta()[:laid], self._cable.position[2, :laid].copy()

    @property
    def cylinder_angle(self) -> float:
        """Theta of the cylinder [rad]."""
        return float(self._drive[ANGLE])

    @property
    def span_tension(self) -> float:
        """Tension of the span [N]."""
        return float(self._drive[TENSION])

    @property
    def cable_used(self) -> float:
        """Reference length of cable that has left the guide [m]."""
        return float(self._reference[: self.nodes - 1].sum())

    @property
    def energy(self) -> EnergyLedger:
        """The energy ledger since the start."""
        cable, k, nodes = self._cable, self._constants, self.nodes
        moving = slice(1, nodes - 1)
        stored = self._contact_energy()
        ledger = self._ledger
        return EnergyLedger(
            kinetic=0.5 * k.mass * float((cable.velocity[:, moving] ** 2).sum())
            + 0.5 * k.roll_inertia * float((cable.roll[1, moving] ** 2).sum()),
            internal=self._internal_energy() + self._torsion_energy(),
            contact=stored,
            external=float(
                ledger[WORK_TIE] + ledger[WORK_SURFACE] + ledger[WORK_SPAN] + ledger[WORK_INFLOW]
            ),
            friction=float(ledger[LOSS_FRICTION]),
            damping=float(ledger[LOSS_CONTACT] + ledger[LOSS_DAMPING]),
            initial=self._initial_energy,
        )

    def save(self, path: Path) -> None:
        """Write the whole state; `load` resumes bit for bit."""
        nodes = self.nodes
        scalars = np.array([self.time, self._surface_step, self._initial_energy])
        counters = np.array([self.nodes, self.steps, self.element_steps])
        arrays = {name: getattr(self._cable, name)[..., :nodes].copy() for name in Points._fields}
        with path.open("wb") as file:
            np.savez(
                file,
                scalars=scalars,
                counters=counters,
                drive=self._drive,
                ledger=self._ledger,
                reference=self._reference[:nodes],
                signature=np.array(self._signature()),
                **arrays,
            )

    @classmethod
    def load(cls, path: Path, config: WindingConfig) -> RodWinding:
        """Return the model that `save` wrote, to be advanced with the same configuration.

        Raises:
            ValueError: The file was written with another configuration.
        """
        model = cls(config)
        with np.load(path) as stored:
            if str(stored["signature"]) != model._signature():
                raise ValueError(f"{path} was saved with another configuration of the model")
            model.nodes, model.steps, model.element_steps = map(int, stored["counters"])
            model.time, model._surface_step, model._initial_energy = map(float, stored["scalars"])
            model._drive, model._ledger = stored["drive"], stored["ledger"]
            model._grow(2 * model.nodes)
            model._reference[: model.nodes] = stored["reference"]
            for name in Points._fields:
                getattr(model._cable, name)[..., : model.nodes] = stored[name]
        return model

    def _run(self, t: float, span: float, drive: FloatArray) -> None:
        total = max(1, math.ceil(span / self.step_limit))
        dt = span / total
        done = 0
        begin = drive.copy()
        while done < total:
            part = drive.copy()
            part[:, 0] = begin[:, 0]
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
                self._table,
                self._ledger,
                self.config.rolling,
            )
            done += taken
            self.steps += taken
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
                begin = part_way(drive, done / total, span)

    def _grow(self, capacity: int) -> None:
        old, reference = self._cable, self._reference
        self._cable = empty_points(capacity)
        self._reference = np.zeros(capacity)
        self._work = empty_work(capacity)
        used = reference.shape[0]
        self._reference[:used] = reference[:capacity]
        for name in Points._fields:
            getattr(self._cable, name)[..., :used] = getattr(old, name)[..., :capacity]

    def _response(self, tension: float) -> tuple[float, float]:
        """Return (stretch of the span, radius at which its nodes land [m]) at a tension [N].

        The radius makes up for the chords and for the depth to which the penalty lets the
        wound cable sink.
        """
        pulls, stretches, radii = self._responses
        if not pulls[0] <= tension <= pulls[-1]:
            self._law.stretch_at(tension / self.config.case.section_area)
            raise ValueError(f"tension {tension:.4g} N stretches the cable beyond the tables")
        return (
            float(np.interp(tension, pulls, stretches)),
            float(np.interp(tension, pulls, radii)),
        )

    def _internal_energy(self) -> float:
        cable, k = self._cable, self._constants
        elements = self.nodes - 2
        stretching = stored_energy(
            elements,
            cable.position,
            self._reference,
            self._table,
            k.table_low,
            k.table_per_spacing,
            k.area,
        )
        edges = np.diff(cable.position[:, : self.nodes], axis=1)
        tangents = edges / np.sqrt((edges**2).sum(axis=0))
        cosine = np.ones(self.nodes)
        cosine[1:-1] = (tangents[:, 1:] * tangents[:, :-1]).sum(axis=0)
        angle = self._drive[ANGLE] if self.steps else 0.0
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

    def _contact_energy(self) -> float:
        cable, k = self._cable, self._constants
        touching = np.flatnonzero(cable.touching[: self.nodes])
        radius = np.hypot(cable.position[0, touching], cable.position[1, touching])
        depth = np.maximum(cable.contact_radius[touching] - radius, 0.0)
        normal = 0.5 * k.normal_stiffness * float((depth**2).sum())
        stick = 0.5 * k.stick_stiffness * float((cable.slip[:, touching] ** 2).sum())
        return normal + stick

    def _arc(self) -> FloatArray:
        s = np.zeros(self.nodes)
        np.cumsum(self._reference[: self.nodes - 1], out=s[1:])
        return s

    def _theta(self) -> FloatArray:
        x, y = self._cable.position[0, : self.nodes], self._cable.position[1, : self.nodes]
        turn = np.arctan2(x[:-1] * y[1:] - y[:-1] * x[1:], x[:-1] * x[1:] + y[:-1] * y[1:])
        theta = np.zeros(self.nodes)
        np.cumsum(-turn, out=theta[1:])
        return theta

    def _laid_nodes(self) -> int:
        touching = np.flatnonzero(self._cable.touching[: self.nodes])
        return int(touching[-1]) + 1 if touching.size else 1

    def _signature(self) -> str:
        return repr([(f.name, getattr(self.config, f.name)) for f in fields(self.config)])
