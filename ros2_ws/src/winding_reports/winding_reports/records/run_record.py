"""What a run of the graph leaves behind: time series, markers at the end, counters."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.cases import Case, PublishedMarker, published_markers
from winding_core.cable.material_report import MaterialReport
from winding_core.error_verdict import CAMERA, EXPERIMENT, ErrorVerdict, MarkerError, error_pct
from winding_core.machine.drive import DriveProfile
from winding_core.machine.drum import Drum
from winding_core.markers import MARKER_DTYPE, Markers
from winding_core.run_outcome import RunOutcome
from winding_core.units import json_values
from winding_reports.records.identity import Identity
from winding_reports.records.lay_outcome import LayOutcome, outcome_json
from winding_reports.trace import LengthTrace, hop_costs

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class WoundCable:
    """A wound cable in the frame of the laboratory."""

    case: Case  # What was wound
    # Centreline, P0 first [m], shape (n, 3), n at least 2.
    nodes: NDArray[np.float64] = field(compare=False, repr=False)
    # Nominal strain there, shape (n,).
    strain: NDArray[np.float64] = field(compare=False, repr=False)
    # Wound angle [rad] and axial position [m] of the wound markers, relative to P0; number 0 is P0,
    # which is missing where the cable does not reach back to it.
    marks: Mapping[int, tuple[float, float]]
    drum: Drum | None = None  # Between whose flanges it lies; None for a bare cylinder

    def __post_init__(self) -> None:
        if self.nodes.shape != (len(self.strain), 3) or len(self.strain) < 2:
            raise ValueError(f"a cable needs two nodes or more, got shape {self.nodes.shape}")

    @property
    def wound_strain(self) -> NDArray[np.float64]:
        """Strain of what lies on the cylinder, shape (k,)."""
        x, y, _ = self.nodes.T
        # The span comes last, on the side of the guide.
        landed = np.flatnonzero((y > -0.2 * self.case.centreline_radius) & (x > 0.0))
        return self.strain[1 : max(2, int(landed[-1]) + 1 if landed.size else 0)]


@dataclass(frozen=True, kw_only=True)
class Signal:
    """One quantity over time."""

    t: Array  # Stamps [s], shape (n,)
    value: Array  # In SI, shape (n,)

    def __post_init__(self) -> None:
        if self.t.shape != self.value.shape or self.t.ndim != 1:
            raise ValueError(f"a signal needs one value per stamp, got {self.value.shape}")


@dataclass(frozen=True, kw_only=True)
class AxisSpeeds:
    """Measured and wanted speeds of both axes in a run."""

    drive: DriveProfile  # The wanted speeds
    cylinder_speed: Signal  # Measured [rad/s]
    carriage_speed: Signal  # Measured [m/s]
    cylinder_setpoint: Signal  # Commanded [rad/s]
    carriage_setpoint: Signal  # Commanded [m/s]

    @property
    def end(self) -> float:
        """Time at which the run's time axes end [s]."""
        return float(self.cylinder_speed.t[-1])


@dataclass(frozen=True, kw_only=True)
class MarkerSeries:
    """Wound markers over time, one row per marker and message."""

    t: Array  # Stamps [s], shape (n,)
    id: NDArray[np.int64]  # Marker numbers, shape (n,)
    theta: Array  # Wound angle [rad], shape (n,)
    z: Array  # Axial position relative to P0 [m], shape (n,)
    s: Array  # Curve length [m], shape (n,)
    sigma_theta: Array  # One standard deviation of theta [rad], shape (n,)
    sigma_z: Array  # One standard deviation of z [m], shape (n,)

    def __post_init__(self) -> None:
        for item in fields(self):
            if getattr(self, item.name).shape != self.t.shape:
                raise ValueError(f"{item.name} needs one value per stamp")

    @classmethod
    def empty(cls) -> Self:
        """Return a series without rows."""
        return cls.of_records(np.zeros(0), np.zeros(0, dtype=MARKER_DTYPE))

    @classmethod
    def of_records(cls, t: Array, records: Markers) -> Self:
        """Return marker records stamped t [s], shape (n,) each, as columns."""
        columns = {item.name: records[item.name].astype(float) for item in fields(cls)[2:]}
        return cls(t=t, id=records["id"].astype(np.int64), **columns)

    def of(self, marker: int) -> MarkerSeries:
        """Return the rows of one marker."""
        mine = self.id == marker
        return MarkerSeries(**{item.name: getattr(self, item.name)[mine] for item in fields(self)})


@dataclass(frozen=True, kw_only=True)
class MarkerRow:
    """One marker at the end of the run; None where there is no such number."""

    id: int  # n of Pn
    original: float  # n marker spacings [m]
    s_fem: float | None = None  # Predicted curve length [m]
    s_tracked: float | None = None  # Measured by the camera in this run [m]
    theta_tracked: float | None = None  # Its mean place there [rad]
    z_tracked: float | None = None  # [m]
    sigma_theta: float | None = None  # One standard deviation of theta_tracked [rad]
    sigma_z: float | None = None  # One standard deviation of z_tracked [m]
    h: float | None = None  # Correction factor
    h_held_out: float | None = None  # The learned factor of a training that never saw this case
    s_corrected: float | None = None  # h S_FEM [m]
    s_low: float | None = None  # Lower end of its interval [m]
    s_high: float | None = None  # Upper end of its interval [m]
    s_published: float | None = None  # Measured in the paper's experiment [m]
    s_rod: float | None = None  # Of the rod, ahead of a run with another element [m]

    @property
    def error_fem_pct(self) -> float | None:
        """Error of the prediction against the published experiment, Table 7's measure."""
        return error_pct(self.s_published, self.s_fem)

    @property
    def error_corrected_pct(self) -> float | None:
        """Error of the corrected prediction against the published experiment, as Table 8."""
        return error_pct(self.s_published, self.s_corrected)

    @property
    def s_held_out(self) -> float | None:
        """The prediction times the factor of a training that never saw this case [m]."""
        if self.s_fem is None or self.h_held_out is None:
            return None
        return self.h_held_out * self.s_fem


def judge_lengths(
    rows: Sequence[MarkerRow],
    limit_pct: float,
    *,
    published: bool,
    asked: int | None = None,
    ended: bool = True,
) -> ErrorVerdict:
    """Return what the lengths of a run are worth.

    Args:
        rows: Of every marker.
        limit_pct: Largest error that counts as good [%].
        published: Whether the paper's experiment is the measure; else the run's own camera.
        asked: How many of them were to be judged; None for those with a predicted length.
        ended: Whether the run came to its end.
    """
    errors = []
    for row in rows:
        measured = row.s_published if published else row.s_tracked
        errors.append(
            MarkerError(
                id=row.id,
                predicted=error_pct(measured, row.s_fem),
                corrected=error_pct(measured, row.s_corrected),
                held_out=error_pct(measured, row.s_held_out),
            )
        )
    return ErrorVerdict(
        limit_pct=limit_pct,
        against=EXPERIMENT if published else CAMERA,
        errors=tuple(errors),
        asked=sum(row.s_fem is not None for row in rows) if asked is None else asked,
        ended=ended,
    )


@dataclass(frozen=True, kw_only=True)
class RunRecord(AxisSpeeds):
    """A finished run."""

    case: Case  # What was wound
    tension: Signal  # Load cell [N]
    predicted: MarkerSeries  # Markers of the solver in step
    tracked: MarkerSeries  # Markers of the camera
    corrected: MarkerSeries  # Markers after the correction factor
    rows: tuple[MarkerRow, ...]  # P1, P2, ... at the end of the run
    outcome: RunOutcome  # How it came out
    frames: int | None = None  # Camera frames tracked
    frames_lost: int | None = None  # Camera frames that never reached the recorder
    joint_states: int | None = None  # Encoder samples recorded
    joint_states_lost: int | None = None  # Encoder samples that never reached the recorder
    wall_s: float | None = None  # Wall time of the run [s]
    sim_s: float | None = None  # Simulated time of the run [s]
    # Short facts by name for the head of the report, such as the trained factor.
    facts: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()  # Sentences on what the numbers are worth
    # The ways to its corrected lengths; None for a run that was not traced.
    trace: LengthTrace | None = None
    # What became of the wanted lay; None for a run without a controller of the lay.
    lay: LayOutcome | None = None
    identity: Identity = field(default_factory=Identity)  # Which run this was
    # The predicted cable at the end; None where the solver published none.
    cable: WoundCable | None = None
    element: str = "rod"  # That predicted
    # Markers as the rod predicted them ahead of the run; empty where it is the element.
    rod: MarkerSeries = field(default_factory=MarkerSeries.empty)
    material: MaterialReport | None = None  # As the markers determine it, at the end
    # Base, joints and eye of the arm that carried the guide at its first and its last place, in
    # `winder_axis` [m], shape (2, points, 3); None for a carriage.
    arm: NDArray[np.float64] | None = None

    @property
    def marker_ids(self) -> tuple[int, ...]:
        """The markers that the run is about."""
        return tuple(row.id for row in self.rows)

    @property
    def published(self) -> tuple[PublishedMarker, ...]:
        """The paper's markers of this case; none for another condition."""
        return published_markers(self.case.number) if self.case.is_published else ()

    @property
    def verdict(self) -> ErrorVerdict:
        """Whether the corrected lengths are good, against the best measure that there is."""
        assert self.outcome.lengths is not None
        return self.outcome.lengths

    @property
    def end(self) -> float:
        """Time at which the run's time axes end [s]."""
        stamps = [
            float(series.t.max()) for series in (self.predicted, self.tracked) if series.t.size
        ]
        return max([self.sim_s or 0.0, *stamps]) or 1.0


# Numbers of a marker in JSON: fields of `MarkerRow`, lengths and angles with their units.
_OF_A_ROW = (
    *("original_m", "s_fem_m", "s_tracked_m", "theta_tracked_rad", "z_tracked_m"),
    *("sigma_theta_rad", "sigma_z_m", "h", "h_held_out", "s_corrected_m", "s_published_m"),
    *("error_fem_pct", "error_corrected_pct"),
)


def run_json(record: RunRecord) -> dict[str, Any]:
    """Return the run's numbers as JSON values; null where nothing was measured.

    Of equal runs all but ``identity``, ``wall_s`` and ``material`` is equal: a comparison leaves
    these out. How many markers a material is identified from depends on the computer.
    """
    return {
        "identity": record.identity.as_json(),
        "case": record.case.number,
        "outcome": record.outcome.as_json(),
        "ended": record.outcome.ending.text or None,
        "markers": [
            {
                "id": row.id,
                **json_values(row, *_OF_A_ROW, *([] if record.element == "rod" else ["s_rod_m"])),
                "error_held_out_pct": error_pct(row.s_published, row.s_held_out),
            }
            for row in record.rows
        ],
        **json_values(record, "frames", "frames_lost", "joint_states", "joint_states_lost"),
        **json_values(record, "wall_s", "sim_s"),
        "error_verdict": record.verdict.as_json(),
        **({} if record.material is None else {"material": _material_json(record.material)}),
        **({} if record.trace is None else {"trace": _trace_json(record.trace)}),
        **({} if record.lay is None else _lay_json(record.lay)),
    }


def _lay_json(lay: LayOutcome) -> dict[str, Any]:
    """Return the lay, and the verdict of the run where the controller drove."""
    verdict = {"kept": lay.verdict.kept, "sentence": lay.verdict.sentence}
    return {**({"verdict": verdict} if lay.drove else {}), "lay": outcome_json(lay)}


def _material_json(material: MaterialReport) -> dict[str, Any]:
    return {
        **json_values(material, "law", "young_pa", "standard_error_pa", "half_width_90_pa"),
        **json_values(material, "markers", "taken_up"),
        "refused": material.refusal or None,
    }


def _trace_json(trace: LengthTrace) -> dict[str, Any]:
    return {
        "lengths": trace.lengths,
        **{
            way.name: [
                {"station": cost.station or None, "hop": cost.name}
                | json_values(cost, "median_s", "p99_s", "share")
                for cost in hop_costs(way)
            ]
            for way in trace.ways
        },
    }


def write_run_json(record: RunRecord, path: Path) -> None:
    """Write the run's numbers as strict JSON; missing folders are made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps(run_json(record), indent=2, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")
