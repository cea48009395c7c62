"""The winding that every solver gets, where its markers belong, and what a solver reports.

A pre-stretched cable lies straight from P0 on the cylinder through the guide; the weight pulls
its end along the span, the cylinder turns and the guide feeds as on the machine. Foreign solvers
cannot feed elements in: they carry all the cable that the run will need from the start.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.cases import Case, paper_case
from winding_core.helix import PAPER_FREE_LENGTH, FleetAngleLaw, curve_length
from winding_core.machine.drive import DriveProfile

FloatArray = NDArray[np.float64]

# Cable that is left behind the guide at the end.
TAIL = 0.03


@dataclass(frozen=True, kw_only=True)
class WindingProblem:
    """One winding, in the lab frame of the project (SI).

    Attributes:
        duration: Simulated time [s].
        case: Cable, cylinder, weight and markers.
        segment_length: Reference length of an element [m].
        free_length: Span between contact line and guide [m].
        friction: Coulomb friction between cable and cylinder.
        damping_rate: Mass-proportional damping for solvers that need some [1/s]; it adds less
            than 10 mN of drag.
        drive: Motion of cylinder and guide.
    """

    duration: float
    case: Case = field(default_factory=lambda: paper_case(4))
    segment_length: float = 5.0e-3
    free_length: float = PAPER_FREE_LENGTH
    friction: float = 0.1
    damping_rate: float = 20.0
    drive: DriveProfile = field(default_factory=DriveProfile)

    @property
    def radius(self) -> float:
        """Centreline radius R + r [m]."""
        return self.case.centreline_radius

    @property
    def axial_stiffness(self) -> float:
        """EA [N]."""
        return self.case.material.young * self.case.section_area

    @property
    def stretch(self) -> float:
        """Stretch of a linear cable under the weight, 1 + F / EA."""
        return 1.0 + self.case.weight / self.axial_stiffness

    @property
    def segment_mass(self) -> float:
        """Mass of an element [kg]."""
        return self.case.material.density * self.case.section_area * self.segment_length

    def stations(self, stretch: float) -> FloatArray:
        """Return the nodes' reference arc lengths [m] of a cable that is long enough."""
        angle = self.drive.positions(self.duration)[0]
        length = (self.radius * angle + self.free_length) / stretch + TAIL
        return self.segment_length * np.arange(math.ceil(length / self.segment_length) + 1)


@dataclass(frozen=True, kw_only=True)
class Marks:
    """Where P1.. lie at the end of a run.

    Attributes:
        theta: Wound angle behind P0 [rad], shape (markers,).
        z: [m]
        s: Curve length hypot((R + r) theta, z) [m].
        wound: Whether the marker has passed the contact line.
    """

    theta: FloatArray
    z: FloatArray
    s: FloatArray
    wound: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What one solver did with the problem.

    Attributes:
        solver: Name.
        version: Of the solver's package.
        step: Time step [s].
        elements: At the end.
        cpu_seconds: Processor time of the steps alone, compilation and set-up left out [s].
        duration: Simulated time that was reached [s].
        diverged: Numbers are not finite or the solver gave up.
        stretch: Stretch of its material law under the weight, for its reference.
        wound_radius: Centreline radius at which its law lays the cable [m].
        marks: Where the markers lie.
    """

    solver: str
    version: str
    step: float
    elements: int
    cpu_seconds: float
    duration: float
    diverged: bool
    stretch: float
    wound_radius: float
    marks: Marks

    @property
    def cpu_s_per_sim_s(self) -> float:
        """Processor seconds per simulated second."""
        return self.cpu_seconds / self.duration

    def as_json(self) -> dict[str, Any]:
        """Return plain numbers and lists."""
        record = asdict(self)
        record["marks"] = {name: value.tolist() for name, value in record["marks"].items()}
        return record

    @classmethod
    def from_json(cls, record: dict[str, Any]) -> Outcome:
        """Return the outcome that `as_json` wrote."""
        marks = Marks(**{name: np.asarray(value) for name, value in record["marks"].items()})
        return cls(**{**record, "marks": marks})


def marks_of_nodes(
    position: FloatArray, arc: FloatArray, problem: WindingProblem, time: float
) -> Marks:
    """Return the markers on a polyline of nodes (nodes, 3) with their reference arc lengths."""
    x, y, z = position.T
    turn = np.arctan2(x[1:] * y[:-1] - y[1:] * x[:-1], x[1:] * x[:-1] + y[1:] * y[:-1])
    behind = np.concatenate([[0.0], np.cumsum(turn)])
    place = problem.case.marker_spacing * np.arange(1, problem.case.marker_count + 1)
    theta = np.interp(place, arc, behind)
    height = np.interp(place, arc, z - z[0])
    return Marks(
        theta=theta,
        z=height,
        s=np.asarray(curve_length(problem.radius, theta, height)),
        wound=theta <= problem.drive.positions(time)[0],
    )


def no_slip_marks(problem: WindingProblem, stretch: float, wound_radius: float) -> Marks:
    """Return where markers belong if every piece stays where it lands, at one stretch.

    Kinematic reference: the fleet-angle law for z, and the laid length between markers is their
    spacing times the stretch.
    """
    lay = FleetAngleLaw(
        advance_per_radian=problem.drive.advance_per_radian,
        free_length=problem.free_length,
        radius=wound_radius,
    )
    place = problem.case.marker_spacing * np.arange(1, problem.case.marker_count + 1)
    # Steps of 1 mrad: the trapezoid's error in S is below 1e-9 m.
    angle = np.linspace(0.0, 1.2 * stretch * place[-1] / wound_radius, 40_001)
    speed = np.hypot(wound_radius, lay.slope(angle))
    way = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(angle) * (speed[1:] + speed[:-1]))])
    theta = np.interp(stretch * place, way, angle)
    z = lay.z(theta)
    return Marks(
        theta=theta,
        z=z,
        s=np.asarray(curve_length(problem.radius, theta, z)),
        wound=theta <= problem.drive.positions(problem.duration)[0],
    )
