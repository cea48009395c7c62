"""Wind a cable ahead of time with the finite-element model."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from winding_core import markers as records
from winding_core.cable.condition import Condition
from winding_core.machine.tension import TensionLaw
from winding_study.run_parameters import RunParameters

FloatArray = NDArray[np.float64]

# Data types of sensor_msgs/PointField, from 1.
_POINT_TYPES = ("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8")


@dataclass(frozen=True, kw_only=True)
class Markers:
    """Positions of the markers P0, P1, ... on the cylinder.

    Attributes:
        id: Number n of Pn, shape (n,).
        theta: Wound angle behind P0 [rad], shape (n,).
        z: Axial position relative to P0 [m], shape (n,).
        s: Length of the wound centreline from P0 [m], shape (n,).
        xyz: Position in the frame `winder_axis` [m], shape (n, 3).
        sigma_theta: Standard deviation of theta [rad], shape (n,); 0 for a prediction.
        sigma_z: Standard deviation of z [m], shape (n,); 0 for a prediction.
        flags: Bits of `MarkerFlag`, shape (n,); 0 for a marker without reservation.
    """

    id: NDArray[np.int64]
    theta: FloatArray
    z: FloatArray
    s: FloatArray
    xyz: FloatArray
    sigma_theta: FloatArray
    sigma_z: FloatArray
    flags: NDArray[np.int64]

    @classmethod
    def from_records(cls, rows: records.Markers) -> Markers:
        """Return the markers of a structured array, shape (n,) of the marker dtype."""
        floats = ("theta", "z", "s", "sigma_theta", "sigma_z")
        return cls(
            id=rows["id"].astype(np.int64),
            xyz=records.positions(rows),
            flags=rows["flags"].astype(np.int64),
            **{name: np.array(rows[name], dtype=np.float64) for name in floats},
        )

    @classmethod
    def from_message(cls, cloud: Any) -> Markers:
        """Return the markers of a `sensor_msgs/PointCloud2` that the graph publishes.

        Raises:
            ValueError: The cloud lacks a field, or its size is not that of its points.
        """
        fields = cloud.fields
        dtype = np.dtype(
            {
                "names": [field.name for field in fields],
                "formats": [f"<{_POINT_TYPES[field.datatype - 1]}" for field in fields],
                "offsets": [field.offset for field in fields],
                "itemsize": cloud.point_step,
            }
        )
        return cls.from_records(np.frombuffer(cloud.data, dtype=dtype))

    def __len__(self) -> int:
        return self.id.size

    @property
    def wound(self) -> NDArray[np.bool_]:
        """Mask of the markers that lie on the cylinder, shape (n,)."""
        mask: NDArray[np.bool_] = (self.flags & records.MarkerFlag.NOT_WOUND) == 0
        return mask


@dataclass(frozen=True, kw_only=True)
class Cable:
    """Nodes of the cable's centreline, from P0 to the guide.

    Attributes:
        xyz: Position in the frame `winder_axis` [m], shape (k, 3).
        s: Undeformed arc length from P0 [m], shape (k,).
        tension: [N], shape (k,).
        strain: Nominal axial strain, shape (k,).
        twist: [rad/m], shape (k,); 0 unless the cable may roll.
    """

    xyz: FloatArray
    s: FloatArray
    tension: FloatArray
    strain: FloatArray
    twist: FloatArray


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """A run wound ahead.

    Attributes:
        condition: What was wound.
        markers: P0 to Pn at the end of the run.
        cable: Centreline at the end of the run.
        t: Times of the histories [s], shape (m,).
        theta: Wound angle of P0 to Pn over time [rad], shape (m, n + 1).
        z: Axial position over time [m], shape (m, n + 1).
        s: Length from P0 over time [m], shape (m, n + 1).
        cable_per_turn: Undeformed cable in each complete turn [m], shape (turns,).
        pitch_per_turn: Axial advance of each complete turn [m], shape (turns,).
        lies_per_turn: "apart", "touching" a turn laid before or "on cable", for each complete turn.
        stretch: Mean stretch of the wound cable.
        stretch_closed_form: Stretch by the material law at the wound tension, for comparison.
        energy_balance: Energy that is not accounted for, as a share of the energy supplied.
        warnings: Doubts of the solver about the condition, one sentence each.
    """

    condition: Condition
    markers: Markers
    cable: Cable
    t: FloatArray
    theta: FloatArray
    z: FloatArray
    s: FloatArray
    cable_per_turn: FloatArray
    pitch_per_turn: FloatArray
    lies_per_turn: tuple[str, ...]
    stretch: float
    stretch_closed_form: float
    energy_balance: float
    warnings: tuple[str, ...]


def run_parameters(condition: Condition, **solver: object) -> RunParameters:
    """Return the solver's parameters for a condition; those that are None keep their default."""
    given = {name: value for name, value in solver.items() if value is not None}
    return RunParameters(**dataclasses.asdict(condition) | given)


def predict(
    condition: Condition,
    *,
    tension_law: TensionLaw | None = None,
    element: str = "rod",
    segment_length: float | None = None,
    mass_scaling: float | None = None,
    rolling: bool = False,
    rate: float = 50.0,
    progress: Callable[[float], None] | None = None,
) -> Prediction:
    """Wind a whole run with the finite-element model, as `winding predict` does.

    Args:
        condition: Cable, cylinder, load, drive and duration.
        tension_law: Span tension [N] as a function of weight [N], cylinder diameter [m] and wound
            length [m]; None for the condition's own law.
        element: ``rod`` or ``solid``.
        segment_length: Undeformed length of an element [m]; None for a suitable one.
        mass_scaling: Factor on the density; None for 1 with the rod and 400 with the solid.
        rolling: Whether the rod may roll on the cylinder.
        rate: Records of the histories per second [1/s].
        progress: Called with the completed share, 0 to 1.

    Returns:
        The markers, the cable and their histories.

    Raises:
        ValueError: The condition is incomplete, contradictory or outside the model's range.
        SolverError: The integration diverged, or its energy balance is open by more than 1 %.
    """
    run = run_parameters(
        condition,
        element=element,
        segment_length=segment_length,
        mass_scaling=mass_scaling,
        rolling=rolling,
    ).plan()
    if tension_law is not None:
        config = dataclasses.replace(run.config, tension_law=tension_law)
        run = dataclasses.replace(run, config=config)
    found = run.wind(progress, rate=rate)
    nodes = found.cable
    return Prediction(
        condition=condition,
        markers=Markers.from_records(found.markers),
        cable=Cable(
            xyz=records.positions(nodes),
            **{name: np.array(nodes[name]) for name in ("s", "tension", "strain", "twist")},
        ),
        t=found.times,
        theta=np.array(found.history["theta"]),
        z=np.array(found.history["z"]),
        s=np.array(found.history["s"]),
        cable_per_turn=found.cable_per_turn(),
        pitch_per_turn=found.pitch_per_turn(),
        lies_per_turn=found.lies_per_turn(),
        stretch=found.stretch,
        stretch_closed_form=found.stretch_closed_form,
        energy_balance=0.01 * found.energy.balance_pct,
        warnings=tuple(check.sentence for check in run.checks() if check.warned),
    )
