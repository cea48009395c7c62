"""One case wound to its end: as a record, as arrays for the store, as a cable for a picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cable_fem_node.winding.prediction import Prediction
from winding_core.cable.cases import Lay, paper_case, published_markers
from winding_core.markers import is_wound
from winding_reports.records.run_record import WoundCable

Array = NDArray[np.float64]

# Enough for a smooth line; a rod has several hundred nodes at the end of a run.
MOST_NODES = 600


def _no_nodes() -> Array:
    return np.empty((0, 3))


@dataclass(frozen=True, kw_only=True)
class CaseResult:
    """One case wound to its end.

    Attributes:
        lays: Where each wound marker lies, by marker number; an unwound marker is missing.
        nodes: Centreline at the end, P0 first, in the frame of the laboratory [m], shape (n, 3).
        strain: Nominal strain of the centreline there, shape (n,).
    """

    case: int  # Row of Table 1
    lays: dict[int, Lay]
    path_z: dict[int, float]  # z [m] of the predicted path at the measured theta, by marker number
    energy_balance_pct: float  # What the energy ledger cannot explain
    cpu_seconds: float  # Processor time of the run [s]
    nodes: Array = field(default_factory=_no_nodes, compare=False, repr=False)
    strain: Array = field(default_factory=lambda: np.empty(0), compare=False, repr=False)


def result_of(number: int, prediction: Prediction) -> CaseResult:
    """Return what the study keeps of a prediction of a case of Table 1."""
    wound = prediction.markers[is_wound(prediction.markers)]
    reached = prediction.theta[-1]
    cable = prediction.cable
    keep = np.unique(np.linspace(0, cable.size - 1, min(cable.size, MOST_NODES)).astype(int))
    return CaseResult(
        case=number,
        lays={
            int(m["id"]): Lay(theta=float(m["theta"]), z=float(m["z"]), s=float(m["s"]))
            for m in wound
            if m["id"] > 0
        },
        path_z={
            row.marker: float(prediction.z_at(row.experiment.theta))
            for row in published_markers(number)
            if row.experiment is not None and row.experiment.theta <= reached
        },
        energy_balance_pct=float(prediction.energy.balance_pct),
        cpu_seconds=prediction.cpu_seconds,
        nodes=np.column_stack([cable[axis][keep] for axis in "xyz"]).astype(float),
        strain=cable["strain"][keep].astype(float),
    )


def to_arrays(result: CaseResult) -> dict[str, ArrayLike]:
    """Return a result as arrays by name; `from_arrays` reads them back bit for bit."""
    return {
        "case": result.case,
        "lay_markers": np.array(list(result.lays), dtype=np.int64),
        "lays": np.array([(lay.theta, lay.z, lay.s) for lay in result.lays.values()]).reshape(
            -1, 3
        ),
        "path_markers": np.array(list(result.path_z), dtype=np.int64),
        "path_z": np.array(list(result.path_z.values()), dtype=float),
        "energy_balance_pct": result.energy_balance_pct,
        "cpu_seconds": result.cpu_seconds,
        "nodes": result.nodes,
        "strain": result.strain,
    }


def from_arrays(arrays: Mapping[str, NDArray[Any]]) -> CaseResult:
    """Return the result that `to_arrays` took apart.

    Raises:
        KeyError: An array is missing.
    """
    return CaseResult(
        case=int(arrays["case"]),
        lays={
            int(marker): Lay(theta=float(theta), z=float(z), s=float(s))
            for marker, (theta, z, s) in zip(arrays["lay_markers"], arrays["lays"], strict=True)
        },
        path_z={
            int(marker): float(z)
            for marker, z in zip(arrays["path_markers"], arrays["path_z"], strict=True)
        },
        energy_balance_pct=float(arrays["energy_balance_pct"]),
        cpu_seconds=float(arrays["cpu_seconds"]),
        nodes=arrays["nodes"],
        strain=arrays["strain"],
    )


def cable_of(result: CaseResult) -> WoundCable:
    """Return the cable of a case of Table 1."""
    return WoundCable(
        case=paper_case(result.case),
        nodes=result.nodes,
        strain=result.strain,
        marks={0: (0.0, 0.0)} | {n: (lay.theta, lay.z) for n, lay in result.lays.items()},
    )
