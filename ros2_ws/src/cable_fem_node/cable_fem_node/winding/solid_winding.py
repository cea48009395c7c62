"""Winding a run with solid elements, as the paper did: slow, for verification of the rod."""

import math

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.contact_springs import contact_energy, normal_forces
from cable_fem_node.dynamics.state import (
    DivergenceError,
    EnergyLedger,
    FloatArray,
    penalty,
)
from cable_fem_node.rod.rod_records import EYE_X, EYE_Y
from cable_fem_node.solid.solid import Solid
from cable_fem_node.solid.solid_law import SolidLaw
from cable_fem_node.solid.solid_mesh import round_bar
from cable_fem_node.winding.resolved_model import chord_radius
from cable_fem_node.winding.solid_winding_kernels import (
    HOURGLASS,
    INSIDE_OUT,
    KINETIC,
    RAN_OUT,
    REPORT_SIZE,
    SPRINGS,
    STRAIN,
    Machine,
    SolidAdvance,
    SolidScratch,
    advance_solid_winding,
)
from cable_fem_node.winding.winding_config import WindingConfig
from cable_fem_node.winding.winding_model import NODE_DTYPE, WindingModel, wound_angles
from winding_core.machine.readings import GuidePlace
from winding_core.markers import Markers

STEP_SAFETY = 0.8
RIM_NODES = 12

# Share of the wound radius by which the contact springs yield; their reach makes up for it.
SINK_SHARE = 0.002
# Of the free length: so far a guide may be off its place, which moves a lay by as little.
_STEADY = 1.0e-3


class SolidWinding(WindingModel):
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
        config.refuse_rod_material()
        super().__init__(config)
        self._surface_step = 0.0
        resolved, case = config.resolved, config.case
        law, stretch, lateral = resolved.law, resolved.stretch, resolved.lateral
        radius = resolved.wound_radius
        spacing = config.resolved.segment
        length = (radius * wind + config.free_length) / stretch
        count = math.ceil(length / spacing) + 3
        bar = round_bar(case.cable_diameter, spacing * np.arange(count + 1), rim_nodes=RIM_NODES)
        solid = Solid(
            bar.nodes,
            bar.hexes,
            SolidLaw.of(law),
            density=case.material.density * config.mass_scaling,
        )
        u, v, w = bar.nodes.T
        # Section axes: u away from the cylinder's axis, v along it, w against the feed.
        solid.set_nodes(np.column_stack([radius + lateral * u, -stretch * w, lateral * v]))
        flat = lateral * float(u[bar.rim[0]].max())
        arc = stretch * spacing
        load = max(0.0, resolved.wound_tension(resolved.tension)) * arc / radius
        normal = 0.5 * load / (SINK_SHARE * radius)
        lightest = float(solid.mass.min())
        self._touch = penalty(normal, lightest, friction=config.friction, stick_share=0.25)
        # Friction acts on the nodes, or on whole sections and not on them.
        free = self._touch._replace(stick_damping=0.0, friction=0.0, cable_radius=0.0)
        self._nodal = self._touch if config.rolling else free
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
            rolling=config.rolling,
        )
        self.step_limit = STEP_SAFETY * min(
            solid.critical_step(),
            2.0 * math.sqrt(lightest / (normal + float(solid._stiffest.max()))),
        )
        self._scratch = SolidScratch(
            net=np.zeros_like(solid.points.position),
            couple=np.zeros(solid.mass.size),
            grip=np.zeros((3, bar.sections.shape[0])),
            report=np.zeros(REPORT_SIZE),
        )
        self._initial_energy = solid.internal_energy()
        self._scratch.report[STRAIN] = self._initial_energy

    def _begin_at(self, guide: GuidePlace) -> None:
        self._refuse_moved(guide)

    def _refuse_moved(self, guide: GuidePlace) -> None:
        """Refuse a guide that does not keep the place that the free length gives it."""
        own = GuidePlace.beside(self._contact_line, self.config.free_length)
        if math.hypot(guide.x - own.x, guide.y - own.y) > _STEADY * self.config.free_length:
            raise ValueError(
                "the solid element's guide keeps its place across the axis, "
                f"({own.x:.4g}, {own.y:.4g}) m; it stands at ({guide.x:.4g}, {guide.y:.4g}) m: "
                "take element rod"
            )

    def _response(self, tension: float) -> tuple[float, float]:
        """Return zeros: stretch and landing follow from the solid's own elements."""
        return 0.0, 0.0

    def _run(self, t: float, span: float, drive: FloatArray) -> None:
        self._refuse_moved(GuidePlace(x=float(drive[EYE_X, 1]), y=float(drive[EYE_Y, 1])))
        steps = max(1, math.ceil(span / self.step_limit))
        end = SolidAdvance(
            *advance_solid_winding(
                steps,
                span / steps,
                self._surface_step,
                drive,
                self._solid.points,
                self._solid._mesh,
                self._solid.mass,
                self._machine,
                self._touch,
                self._nodal,
                self._scratch,
                self._ledger,
            )
        )
        self._surface_step = end.surface_step
        if end.status == INSIDE_OUT:
            raise DivergenceError(
                f"the solid winding diverged before t = {t:.6g} s at element {end.at}: negative "
                f"Jacobian (step {span / steps:.3g} s)"
            )
        if end.status == RAN_OUT:
            raise DivergenceError(
                f"the cable's end reached the guide before t = {t:.6g} s: at section {end.at}"
            )
        self.element_steps += steps * self._solid.volumes.size

    def wound_path(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return (reference arc length [m], theta [rad], z [m]) of the laid sections."""
        laid = self._laid()
        middle = self._middle()
        theta = wound_angles(middle[:, 0], middle[:, 1])
        return self._bar.axial[:laid], theta[:laid], middle[:laid, 2]

    def markers(self) -> Markers:
        """Return the records of P0..Pn; those not yet on the cylinder carry NOT_WOUND."""
        arc, theta, z = self.wound_path()
        records = self._marker_records(arc, theta, z, float(arc[-1]))
        self._place_loose(records, self._bar.axial, self._middle().T)
        return records

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
        records["roll"] = self._roll(middle, tangent)
        self._fill_twist(records, self._laid())
        return records

    def newest_cable(self, turns: float) -> NDArray[np.void]:
        """Return the sections up to the guide, see `WindingModel`: all of them are integrated."""
        records, laid = self.cable(), self._laid()
        behind = np.flatnonzero(records["y"][laid:] < -self.config.free_length)
        return records[: laid + int(behind[0])]

    def _roll(self, middle: FloatArray, tangent: FloatArray) -> FloatArray:
        """Return by what angle sections have turned about the cable [rad], shape (sections,).

        Args:
            middle: Centres of the sections [m], shape (sections, 3).
            tangent: Directions between them, shape (sections - 1, 3).
        """
        rim = self._bar.rim
        along = np.concatenate([tangent[:1], tangent])
        # In the span the normal is that of the plane in which the cable comes.
        laid = np.arange(middle.shape[0])[:, None] < self._laid()
        normal = np.where(laid, middle * [1.0, 1.0, 0.0], [1.0, 0.0, 0.0])
        normal = normal - (normal * along).sum(axis=1, keepdims=True) * along
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        across = np.cross(along, normal)
        spoke = self._solid.points.position[:, rim].transpose(1, 2, 0) - middle[:, None, :]
        u, v = self._bar.nodes[rim, 0], self._bar.nodes[rim, 1]
        x, y = ((spoke * axis[:, None, :]).sum(axis=2) for axis in (normal, across))
        return np.unwrap(np.arctan2((y * u - x * v).sum(axis=1), (x * u + y * v).sum(axis=1)))

    def wound_stretch(self) -> float:
        """Return the mean stretch between the laid sections."""
        return float(self.cable()["strain"][1 : max(2, self._laid())].mean() + 1.0)

    def contact_forces(self) -> FloatArray:
        """Return the normal force of the cylinder on every section [N], shape (sections,)."""
        forces = normal_forces(self._solid.points, self._touch)
        return np.asarray(forces[self._bar.sections].sum(axis=1))

    def sink(self) -> FloatArray:
        """Return how far the touching nodes of every section have sunk in [m], shape (sections,).

        Zero where a section does not touch.
        """
        touching = self._solid.points.touching[self._bar.sections].sum(axis=1)
        stiffness = self._touch.normal_stiffness * np.maximum(touching, 1)
        return np.asarray(self.contact_forces() / stiffness)

    @property
    def solid(self) -> Solid:
        """The elements, in the state that they are wound in."""
        return self._solid

    @property
    def hourglass_energy(self) -> float:
        """Energy of the hourglass control after the last step [J]."""
        return float(self._scratch.report[HOURGLASS])

    @property
    def energy(self) -> EnergyLedger:
        """The ledger since the start; internal energy includes hourglass energy."""
        report, grip = self._scratch.report, self._scratch.grip
        contact = contact_energy(self._solid.points, self._touch)
        contact += self._touch.stick_stiffness * float((grip[:2] ** 2).sum())
        return EnergyLedger.of(
            self._ledger,
            kinetic=float(report[KINETIC]),
            internal=float(report[STRAIN] + report[HOURGLASS]),
            contact=contact + float(report[SPRINGS]),
            initial=self._initial_energy,
        )

    def _middle(self) -> FloatArray:
        return np.asarray(self._solid.points.position[:, self._bar.sections].mean(axis=2).T)

    def _laid(self) -> int:
        touching = np.flatnonzero(self._solid.points.touching)
        return int(touching[-1]) // self._machine.per_section + 1 if touching.size else 1
