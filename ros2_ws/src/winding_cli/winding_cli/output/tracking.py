"""What `winding track` has to say of a recording: for people, and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rich.table import Table

from winding_core.helix import curve_length
from winding_core.lay_records import name_of
from winding_core.units import MILLIMETRE, MILLIRADIAN

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from marker_tracker_node import LayReport, Refinement
    from marker_tracker_node.tracking.checks.camera_clock import CameraClock
    from marker_tracker_node.tracking.report import TrackerReport

# Of a marker in run means and refinement: [rad], [m] and their standard deviations.
COLUMNS = ("theta", "z", "sigma_theta", "sigma_z")


@dataclass(frozen=True, kw_only=True)
class TrackedRecording:
    """A recording that has been tracked.

    Attributes:
        report: What the tracker says of itself.
        means: Run means: theta [rad], z [m] and their deviations, shape (markers,) each.
        radius: Of the laid cable's centreline [m].
        fit: Markers and camera fitted over the run.
        unrefined: Why there is no fit; empty if there is one or none was wanted.
        clock: The camera's against the encoder's.
        lay: Every turn of cable, where that was wanted.
        remarks: On the recording.
    """

    report: TrackerReport
    means: dict[str, NDArray[np.float64]]
    radius: float
    fit: Refinement | None
    unrefined: str
    clock: CameraClock | None
    lay: LayReport | None
    remarks: tuple[str, ...]

    def said(self) -> Iterator[str | Table]:
        """Yield what is printed."""
        yield from (*self.remarks, *self.report.remarks)
        report = self.report
        refused = sum(report.rejected.values())
        yield f"{report.frames} frames used, {refused} refused, {report.known} markers known"
        yield from (
            f"  {count} x {fault.value}" for fault, count in report.rejected.items() if count
        )
        yield from (f"the pictures contradict: {item.sentence}" for item in report.contradictions)
        yield from report.doubts
        if self.unrefined:
            yield f"not refined: {self.unrefined}"
        if self.fit is not None:
            yield f"refined: {self.fit.residual:.2f} px, {_pose_change(self.fit)}"
        yield self._table()
        yield from self._clock_said()
        yield from self._lay_said()

    def record(self) -> dict[str, Any]:
        """Return the same as plain values, None for what is not known."""
        report, fit = self.report, self.fit
        return {
            "healthy": report.healthy,
            "frames": report.frames,
            "rejected": {
                fault.name.lower(): count for fault, count in report.rejected.items() if count
            },
            "known": report.known,
            "markers": [
                {
                    "id": n,
                    "mean": self._marker(self.means, n),
                    "refined": None if fit is None else self._marker(_values(fit), n),
                }
                for n in range(len(self.means["theta"]))
            ],
            "contradictions": [
                {
                    "number": item.number,
                    "share": _known(item.share),
                    "sigma": _known(item.sigma),
                    "sentence": item.sentence,
                }
                for item in report.contradictions
            ],
            "doubts": list(report.doubts),
            "remarks": [*self.remarks, *report.remarks],
            "refinement": self._fit_record(),
            "camera_clock": self._clock_record(),
            "lay": self._lay_record(),
        }

    def _marker(self, values: dict[str, NDArray[np.float64]], n: int) -> dict[str, Any] | None:
        theta, z, sigma_theta, sigma_z = (float(values[name][n]) for name in COLUMNS)
        if not math.isfinite(theta):
            return None
        return {
            "theta_rad": theta,
            "z_m": z,
            "s_m": float(curve_length(self.radius, theta, z)),
            "sigma_theta_rad": _known(sigma_theta),
            "sigma_z_m": _known(sigma_z),
        }

    def _fit_record(self) -> dict[str, Any] | None:
        if self.fit is None:
            return {"refused": self.unrefined} if self.unrefined else None
        moved, sigma = self.fit.moved.tolist(), self.fit.sigma_pose.tolist()
        return {
            "residual_px": self.fit.residual,
            "camera_tilt_rad": moved[:3],
            "camera_moved_m": moved[3:],
            "sigma_tilt_rad": sigma[:3],
            "sigma_moved_m": sigma[3:],
        }

    def _clock_record(self) -> dict[str, Any] | None:
        if self.clock is None:
            return None
        estimate = self.clock.estimate
        known = math.isfinite(estimate.error)
        return {
            "offset_s": estimate.offset if known else None,
            "error_s": estimate.error if known else None,
            "corrected": self.clock.applied,
            "said": [said for said in (self.clock.refusal, self.clock.warning) if said],
        }

    def _lay_record(self) -> dict[str, Any] | None:
        lay = self.lay
        if lay is None:
            return None
        return {
            "places": len(lay.records),
            "turns": len(set(lay.records["turn"].tolist())),
            "free_length_m": _known(lay.free_length),
            "sigma_free_length_m": _known(lay.sigma_free_length),
            "defects": [
                {"kind": name_of(item.flag), "first_rad": item.first, "last_rad": item.last}
                for item in lay.defects
            ],
        }

    def _table(self) -> Table:
        table = Table("marker")
        columns = self._columns(table, "", self.means)
        if self.fit is not None:
            columns += self._columns(table, "refined ", _values(self.fit))
        for n, cells in enumerate(zip(*columns, strict=True)):
            table.add_row(f"P{n}", *cells)
        return table

    def _columns(
        self, table: Table, what: str, values: dict[str, NDArray[np.float64]]
    ) -> list[list[str]]:
        for heading in ("theta, rad", "z, mm", "S, mm"):
            table.add_column(what + heading)
        theta, z, sigma_theta, sigma_z = (values[name] for name in COLUMNS)
        length = curve_length(self.radius, theta, z)
        cells = (
            [f"{a:.4f} ± {d:.4f}" for a, d in zip(theta, sigma_theta, strict=True)],
            [
                f"{a / MILLIMETRE:.3f} ± {d / MILLIMETRE:.3f}"
                for a, d in zip(z, sigma_z, strict=True)
            ],
            [f"{s / MILLIMETRE:.2f}" for s in length],
        )
        return [
            [cell if math.isfinite(s) else "-" for cell, s in zip(column, length, strict=True)]
            for column in cells
        ]

    def _clock_said(self) -> Iterator[str]:
        if self.clock is None:
            return
        told = self.clock.values()
        yield (
            f"camera clock: {told['camera_clock_offset_ms']} ms ahead of the encoder's, error "
            f"{told['camera_clock_offset_error_ms']} ms, "
            f"{'corrected' if self.clock.applied else 'not corrected'}"
        )
        yield from filter(None, (self.clock.refusal, self.clock.warning))

    def _lay_said(self) -> Iterator[str]:
        lay = self.lay
        if lay is None:
            return
        turns = len(set(lay.records["turn"].tolist()))
        yield f"lay: {len(lay.records)} places of {turns} turns"
        if math.isfinite(lay.free_length):
            length, error = (x / MILLIMETRE for x in (lay.free_length, lay.sigma_free_length))
            yield f"free length: {length:.1f} mm, error {error:.1f} mm"
        for defect in lay.defects:
            yield f"{name_of(defect.flag)}: {defect.first:.2f} to {defect.last:.2f} rad"


def _values(fit: Refinement) -> dict[str, NDArray[np.float64]]:
    return {name: getattr(fit, name) for name in COLUMNS}


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _pose_change(fit: Refinement) -> str:
    """Return how far the camera was moved, with standard deviations."""
    parts = [
        ", ".join(
            f"{change / unit:.2f} ± {sigma / unit:.2f}"
            for change, sigma in zip(fit.moved[axes], fit.sigma_pose[axes], strict=True)
        )
        for axes, unit in ((slice(0, 3), MILLIRADIAN), (slice(3, 6), MILLIMETRE))
    ]
    return f"camera turned by ({parts[0]}) mrad, moved by ({parts[1]}) mm"
