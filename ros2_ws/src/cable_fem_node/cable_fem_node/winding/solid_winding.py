"""Winding a run with solid elements, as the paper did: slow, for verification of the rod."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

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
)
from cable_fem_node.dynamics.surroundings import Touch
from cable_fem_node.solid.solid import Solid
from cable_fem_node.solid.solid_law import SolidLaw
from cable_fem_node.solid.solid_mesh import round_bar
from cable_fem_node.winding.followed_run import follow, refuse_length
from cable_fem_node.winding.prediction import Prediction, refuse_open_balance, refuse_overlap
from cable_fem_node.winding.rod_winding import NODE_DTYPE
from cable_fem_node.winding.solid_winding_kernels import (
    INSIDE_OUT,
    RAN_OUT,
    Machine,
    advance_solid_winding,
)
from cable_fem_node.winding.winding_config import WindingConfig
from cable_fem_node.winding.winding_setup import chord_radius
from cable_fem_node.winding.winding_state import ANGLE, FEED, GUIDE, SPEED, TENSION
from winding_core.drive import PAPER_DURATION, DriveProfile
from winding_core.markers import MarkerFlag, Markers, wound_markers

FloatArray = NDArray[np.float64]

STEP_SAFETY = 0.8
RIM_NODES = 12

# Share of the wound radius by which the contact springs yield; their reach makes up for it.
SINK_SHARE = 0.002


class SolidWinding:
    """A cable of C3D8R elements, wound from its pre-stretched straight state.

    The whole cable is meshed, the part that hangs behind the guide included; sections are
    `segment_length` apart. P0's section turns with the cylinder as a rigid plate, the guide's eye
    holds the cable without friction, the weight pulls the last section along the span. Without
    `rolling` friction acts on whole sections, as on the rod's centreline; with it on the nodes
    that touch, so that the cable may roll and its inner side is held where it lands.

    Args:
        config: The model.
        wind: Angle that shall be wound [rad]; the mesh gets as long as that needs.
    """

    def __init__(self, config: WindingConfig, wind: float) -> None:
        case, law = config.case, config.uniaxial
        self.config = config
        pull = config.weight_tension
        stretch = law.stretch_at(pull / case.section_area)
        radius = config.wound_radius(stretch)
        lateral = float(law.lateral_stretch(stretch))
        spacing = config.segment_length
        length = (radius * wind + config.free_length) / stretch
        count = math.ceil(length / spacing) + 3
        bar = round_bar(case.cable_diameter, spacing * np.arange(count + 1), rim_nodes=RIM_NODES)
        solid = Solid(
            bar.nodes,
            bar.hexes,
            SolidLaw(law=config.law, young=law.young, poisson=law.poisson),
            density=case.material.density * config.mass_scaling,
        )
        u, v, w = bar.nodes.T
        # Section axes: u away from the cylinder's axis, v along it, w against the feed.
        solid.set_nodes(np.column_stack([radius + lateral * u, -stretch * w, lateral * v]))
        flat = lateral * float(u[bar.rim[0]].max())
        arc = stretch * spacing
        load = max(0.0, config.wound_tension(pull)) * arc / radius
        normal = 0.5 * load / (SINK_SHARE * radius)
        lightest = float(solid.mass.min())
        self._touch = Touch(
            normal_stiffness=normal,
            normal_damping=0.4 * math.sqrt(normal * lightest),
            stick_stiffness=0.25 * normal,
            stick_damping=0.2 * math.sqrt(0.25 * normal * lightest),
            friction=config.friction,
            cable_radius=0.0,
        )
        wave = math.sqrt(case.material.young / solid.density)
        self._solid = solid
        self._bar = bar
        self._machine = Machine(
            per_section=bar.sections.shape[1],
            sections=bar.sections.shape[0],
            free_length=config.free_length,
            contact_line=radius,
            landing=chord_radius(radius, arc) + SINK_SHARE * radius - flat,
            eye_stiffness=20.0 * case.material.young * case.section_area / spacing,
            damping_rate=math.pi * config.damping_ratio * wave / config.free_length,
            first=np.ascontiguousarray(solid.points.position[:, bar.sections[0]]),
        )
        self.step_limit = STEP_SAFETY * min(
            solid.critical_step(),
            2.0 * math.sqrt(lightest / (normal + float(solid._stiffest.max()))),
        )
        self.time = 0.0
        self.element_steps = 0
        self._surface_step = 0.0
        self._drive = np.zeros(7)
        self._drive[TENSION] = pull
        self._ledger = np.zeros(LEDGER_SIZE)
        self._report = np.zeros(5)
        self._report[0] = self._initial_energy = solid.internal_energy()
        self._net = np.zeros_like(solid.points.position)
        self._couple = np.zeros(solid.mass.size)
        self._grip = np.zeros((3, bar.sections.shape[0]))

    def advance_to(
        self,
        t: float,
        *,
        cylinder_angle: float,
        angular_speed: float,
        guide_z: float,
        feed_speed: float,
    ) -> None:
        """Advance to a time at which the machine stands and moves as given.

        Args:
            t: [s], not before the last one.
            cylinder_angle: Theta [rad].
            angular_speed: [rad/s].
            guide_z: [m].
            feed_speed: [m/s].

        Raises:
            DivergenceError: An element turned inside out, or the cable has run out.
            ValueError: Time runs backwards or is not finite.
        """
        span = t - self.time
        if not (math.isfinite(span) and span >= 0.0):
            raise ValueError(f"time must not run backwards: at {self.time} s, asked for {t} s")
        if span == 0.0:
            return
        case = self.config.case
        drive = np.empty((7, 2))
        drive[:, 0] = drive[:, 1] = self._drive
        drive[ANGLE, 1], drive[SPEED, 1] = cylinder_angle, angular_speed
        drive[GUIDE, 1], drive[FEED, 1] = guide_z, feed_speed
        drive[TENSION, 1] = self.config.tension_law(
            case.weight, case.cylinder_diameter, self._machine.contact_line * cylinder_angle
        )
        steps = max(1, math.ceil(span / self.step_limit))
        status, at, self._surface_step = advance_solid_winding(
            steps,
            span / steps,
            self._surface_step,
            drive,
            self._solid.points,
            self._solid._mesh,
            self._solid.mass,
            self._net,
            self._couple,
            self._machine,
            self._touch,
            self._ledger,
            self._report,
            self._grip,
            self.config.rolling,
        )
        if status == INSIDE_OUT:
            raise DivergenceError(
                f"the solid winding diverged before t = {t:.6g} s at element {at}: negative "
                f"Jacobian (step {span / steps:.3g} s)"
            )
        if status == RAN_OUT:
            raise DivergenceError(
                f"the cable's end reached the guide before t = {t:.6g} s: at section {at}"
            )
        self.time = t
        self.element_steps += steps * self._solid.volumes.size
        self._drive = drive[:, 1].copy()

    def path(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (reference arc length [m], theta [rad], z [m]) of the laid sections."""
        laid = self._laid()
        middle = self._middle()
        turn = np.arctan2(
            middle[:-1, 0] * middle[1:, 1] - middle[:-1, 1] * middle[1:, 0],
            middle[:-1, 0] * middle[1:, 0] + middle[:-1, 1] * middle[1:, 1],
        )
        theta = np.concatenate([[0.0], np.cumsum(-turn)])
        return self._bar.axial[:laid], theta[:laid], middle[:laid, 2]

    def markers(self) -> Markers:
        """Return the records of P0..Pn; those not yet on the cylinder carry NOT_WOUND."""
        case = self.config.case
        ids = np.arange(case.marker_count + 1)
        place = ids * case.marker_spacing
        arc, theta, z = self.path()
        loose = place > arc[-1]
        return wound_markers(
            ids=ids,
            theta=np.interp(place, arc, theta),
            z=np.interp(place, arc, z),
            radius=case.centreline_radius,
            cylinder_angle=float(self._drive[ANGLE]),
            flags=np.where(loose, int(MarkerFlag.NOT_WOUND), 0),
        )

    def cable(self) -> NDArray[np.void]:
        """Return the sections' centres as records x y z s tension strain, from P0 on.

        Tension and strain of a section belong to the elements towards P0; the tension is the
        mean first Piola stress along the cable times the section.
        """
        solid = self._solid
        middle = self._middle()
        records = np.zeros(middle.shape[0], dtype=NODE_DTYPE)
        for column, name in enumerate("xyz"):
            records[name] = middle[:, column]
        records["s"] = self._bar.axial
        length = np.linalg.norm(np.diff(middle, axis=0), axis=1)
        tangent = np.diff(middle, axis=0) / length[:, None]
        per = solid.volumes.size // length.size
        stress = solid.law.first_piola(solid.gradients())[:, :, 2].reshape(length.size, per, 3)
        volume = solid.volumes.reshape(length.size, per)
        force = (stress * volume[:, :, None]).sum(axis=1) / np.diff(self._bar.axial)[:, None]
        records["tension"][1:] = (force * tangent).sum(axis=1)
        records["strain"][1:] = length / np.diff(self._bar.axial) - 1.0
        records["tension"][0], records["strain"][0] = records["tension"][1], records["strain"][1]
        return records

    @property
    def energy(self) -> EnergyLedger:
        """The ledger since the start; internal energy includes hourglass energy."""
        stored, wavy, kinetic, springs, _ = self._report
        points, touch = self._solid.points, self._touch
        touching = points.touching == 1
        radius = np.hypot(points.position[0, touching], points.position[1, touching])
        depth = np.maximum(points.contact_radius[touching] - radius, 0.0)
        contact = 0.5 * touch.normal_stiffness * float((depth**2).sum())
        contact += 0.5 * touch.stick_stiffness * float((points.slip[:, touching] ** 2).sum())
        contact += touch.stick_stiffness * float((self._grip[:2] ** 2).sum())
        ledger = self._ledger
        return EnergyLedger(
            kinetic=float(kinetic),
            internal=float(stored + wavy),
            contact=contact + float(springs),
            external=float(
                ledger[WORK_TIE] + ledger[WORK_SURFACE] + ledger[WORK_SPAN] + ledger[WORK_INFLOW]
            ),
            friction=float(ledger[LOSS_FRICTION]),
            damping=float(ledger[LOSS_CONTACT] + ledger[LOSS_DAMPING]),
            initial=self._initial_energy,
        )

    @property
    def hourglass_share(self) -> float:
        """Hourglass energy over internal energy."""
        return float(self._report[1] / (self._report[0] + self._report[1]))

    def _middle(self) -> FloatArray:
        return np.asarray(self._solid.points.position[:, self._bar.sections].mean(axis=2).T)

    def _laid(self) -> int:
        touching = np.flatnonzero(self._solid.points.touching)
        return int(touching[-1]) // self._machine.per_section + 1 if touching.size else 1


def predict_solid(
    config: WindingConfig,
    drive: DriveProfile | None = None,
    duration: float = PAPER_DURATION,
    progress: Callable[[float], None] | None = None,
    *,
    rate: float = 50.0,
    cpu_clock: Callable[[], float] = time.process_time,
) -> Prediction:
    """Wind a whole run ahead with solid elements; arguments and errors as `predict`.

    Raises:
        ValueError: Duration [s] or rate [Hz] is not positive and finite.
    """
    drive = DriveProfile() if drive is None else drive
    refuse_length(duration, rate)
    refuse_overlap(config, drive)
    model = SolidWinding(config, drive.positions(duration)[0])
    run = follow(model, drive, duration, progress, rate=rate, cpu_clock=cpu_clock)
    energy = model.energy
    refuse_open_balance(energy, duration)
    arc, theta, z = model.path()
    cable = model.cable()
    weight = float(model._drive[TENSION])
    return Prediction(
        config=config,
        drive=drive,
        times=run.times,
        history=run.history,
        arc=arc,
        theta=theta,
        z=z,
        cable=cable,
        energy=energy,
        stretch=float(cable["strain"][1 : max(2, arc.size)].mean() + 1.0),
        stretch_closed_form=config.wound_stretch(weight),
        span_stretch=config.uniaxial.stretch_at(weight / config.case.section_area),
        cpu_seconds=run.cpu_seconds,
        element_steps=model.element_steps,
    )
