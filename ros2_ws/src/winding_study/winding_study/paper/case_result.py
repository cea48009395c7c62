"""A case wound to its end: as a record, as arrays, and beside the experiment by marker."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from statistics import fmean
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cable_fem_node.winding.prediction import Prediction
from winding_core.cable.cases import (
    Lay,
    PublishedMarker,
    length_error_pct,
    paper_case,
    published_markers,
)
from winding_core.markers import is_wound
from winding_core.units import MILLIMETRE, json_values
from winding_reports.records.run_record import WoundCable

Array = NDArray[np.float64]

MOST_NODES = 600  # Enough for a smooth line; a rod has several hundred nodes at the end of a run


@dataclass(frozen=True, kw_only=True)
class CaseResult:
    """One case wound to its end."""

    case: int  # Row of Table 1
    # Where each wound marker lies, by marker number; an unwound marker is missing.
    lays: dict[int, Lay]
    path_z: dict[int, float]  # z [m] of the predicted path at the measured theta, by marker number
    energy_balance_pct: float  # What the energy ledger cannot explain
    cpu_seconds: float  # Processor time of the run [s]
    # Centreline at the end, P0 first, in the frame of the laboratory [m], shape (n, 3).
    nodes: Array = field(default_factory=lambda: np.empty((0, 3)), compare=False, repr=False)
    # Nominal strain of the centreline there, shape (n,).
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


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One measured marker: predicted, measured, and how far apart."""

    case: int  # Row of Table 1
    marker: int  # n of Pn
    original_m: float  # n marker spacings
    theta_rad: float  # Predicted wound angle
    z_m: float  # Predicted axial position
    s_m: float  # Predicted curve length
    theta_exp_rad: float  # Measured wound angle
    z_exp_m: float  # Measured axial position
    s_exp_m: float  # Measured curve length
    error_pct: float  # Table 7's measure of the length
    dz_mm: float  # Predicted minus measured z of this marker
    # Predicted minus measured z at the measured theta; None where the path of the prediction is not
    # known there.
    dz_path_mm: float | None
    dtheta_rad: float  # Predicted minus measured theta


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """All measured cells of one prediction, and their means."""

    cells: tuple[Cell, ...]

    @property
    def keys(self) -> list[tuple[int, int]]:
        """(case, marker) of every cell."""
        return [(cell.case, cell.marker) for cell in self.cells]

    @property
    def mean_error_pct(self) -> float:
        """Mean error of a length, Table 7's measure."""
        return fmean(cell.error_pct for cell in self.cells)

    @property
    def mean_abs_dz_mm(self) -> float:
        """Mean |z - z_exp|, marker by marker."""
        return fmean(abs(cell.dz_mm) for cell in self.cells)

    @property
    def mean_abs_dz_path_mm(self) -> float | None:
        """Mean |z - z_exp| at the measured theta; None unless known for every cell."""
        known = [abs(cell.dz_path_mm) for cell in self.cells if cell.dz_path_mm is not None]
        return fmean(known) if len(known) == len(self.cells) else None

    @property
    def mean_abs_dtheta_rad(self) -> float:
        """Mean |theta - theta_exp|."""
        return fmean(abs(cell.dtheta_rad) for cell in self.cells)

    def as_json(self) -> dict[str, Any]:
        """Return means and cells as JSON values."""
        return {
            **json_values(self, "mean_error_pct", "mean_abs_dz_mm"),
            **json_values(self, "mean_abs_dz_path_mm", "mean_abs_dtheta_rad"),
            "cells": [asdict(cell) for cell in self.cells],
        }


def compare(results: Iterable[CaseResult], *, partial: bool = False) -> Comparison:
    """Return this project's prediction beside the experiment.

    Args:
        results: Cases that were wound.
        partial: Leave out measured markers that the runs were too short for.

    Raises:
        ValueError: A measured marker was not wound, or with `partial` none was.
    """
    by_case = {result.case: result for result in results}
    cells = []
    for row in published_markers():
        if row.case not in by_case or row.experiment is None:
            continue
        result = by_case[row.case]
        if row.marker not in result.lays:
            if partial:
                continue
            raise ValueError(f"case {row.case} marker {row.marker} was measured but is not wound")
        cells.append(_cell(row, result.lays[row.marker], row.experiment, result.path_z))
    if not cells:
        raise ValueError("the runs are too short: no measured marker is wound")
    return Comparison(cells=tuple(cells))


def compare_paper(keys: Iterable[tuple[int, int]] | None = None) -> Comparison:
    """Return the paper's simulation columns beside the experiment.

    Four points of its path are printed, a turn apart: too few for z at another theta.

    Args:
        keys: (case, marker) of the cells that are asked for; all measured ones by default.
    """
    asked = None if keys is None else set(keys)
    return Comparison(
        cells=tuple(
            _cell(row, row.simulation, row.experiment, {})
            for row in published_markers()
            if row.experiment is not None and (asked is None or (row.case, row.marker) in asked)
        )
    )


def _cell(row: PublishedMarker, predicted: Lay, measured: Lay, path_z: Mapping[int, float]) -> Cell:
    path = path_z.get(row.marker)
    return Cell(
        case=row.case,
        marker=row.marker,
        original_m=row.original_length,
        theta_rad=predicted.theta,
        z_m=predicted.z,
        s_m=predicted.s,
        theta_exp_rad=measured.theta,
        z_exp_m=measured.z,
        s_exp_m=measured.s,
        error_pct=length_error_pct(measured.s, predicted.s),
        dz_mm=(predicted.z - measured.z) / MILLIMETRE,
        dz_path_mm=None if path is None else (path - measured.z) / MILLIMETRE,
        dtheta_rad=predicted.theta - measured.theta,
    )
