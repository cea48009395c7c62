"""`winding track`: measure the markers of a recorded run, without ROS."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from marker_tracker_node.camera.image_formats import PixelReader
from winding_cli.terminal.console import Shown, busy, marker_name, record_table, result_console
from winding_cli.terminal.output_path import Force, Json, check_output_file, staged, write_json
from winding_cli.terminal.record_options import Typed, spelled, with_options
from winding_cli.terminal.refusal import FAILED, refuse, refused
from winding_core.cable.condition import Condition
from winding_core.helix import curve_length
from winding_core.lay.records import name_of
from winding_core.machine.readings import AxisReading
from winding_core.markers import MarkerParameters
from winding_core.parameters import typed_record
from winding_core.run_options import CameraClockParameters, CameraPixels, CameraPlacement
from winding_core.units import MILLIMETRE, MILLIRADIAN, json_values, known

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from rich.table import Table

    from marker_tracker_node import LayReport, PinholeCamera, PoseBelief, Refinement, Tracker
    from marker_tracker_node.camera.recordings import Motion
    from marker_tracker_node.tracking.camera_clock import CameraClock
    from marker_tracker_node.tracking.report import TrackerReport
    from marker_tracker_node.tracking.synchronised_tracker import SynchronisedTracker
    from winding_core.markers import Markers

_UNLOADED = 1.0e-3  # The least tension that a condition may have [N]


@with_options(Condition, CameraClockParameters, CameraPlacement, MarkerParameters, CameraPixels)
def track(
    typed: Typed,
    clock: Typed,
    placement: Typed,
    markers: Typed,
    pixels: Typed,
    *,
    source: Annotated[Path, typer.Argument(help="Video file, folder of pictures, or bag.")],
    out: Annotated[Path, typer.Option("--output", "--out", help="CSV of every frame's markers.")],
    camera: Annotated[
        Path | None, typer.Option(help="Camera YAML; a bag may bring its own camera_info.")
    ] = None,
    motion: Annotated[
        Path | None,
        typer.Option(help="CSV t, cylinder_angle, guide_z; a bag may bring joint_states."),
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(help="Of pictures without times; of a video in place of its own times."),
    ] = None,
    json_file: Json = None,
    lay: Annotated[
        Path | None, typer.Option(help="CSV of every turn on the cylinder, every 5 degrees.")
    ] = None,
    refined: Annotated[
        bool, typer.Option("--refine/--no-refine", help="Fit the camera's pose over the run.")
    ] = True,
    camera_position_sigma_mm: Annotated[
        float, typer.Option(min=0.0, help="Standard deviation of its position; a tape measure's.")
    ] = 2.0,
    camera_tilt_sigma_mrad: Annotated[
        float, typer.Option(min=0.0, help="Standard deviation of its direction; a spirit level's.")
    ] = 10.0,
    force: Force = False,
) -> None:
    """Track a recording and print where every marker lies."""
    from marker_tracker_node import PoseBelief, Tracker
    from marker_tracker_node.camera.calibration import read_camera
    from marker_tracker_node.camera.frame_sources import FrameSource, Recording, is_bag, read_bag
    from marker_tracker_node.camera.recordings import read_motion, write_measurements
    from marker_tracker_node.lay.lay_follower import LayFollower, write_lay
    from marker_tracker_node.tracking.camera_clock import ClockSettings
    from marker_tracker_node.tracking.config import TrackerConfig
    from marker_tracker_node.tracking.encoder_history import EncoderHistory
    from marker_tracker_node.tracking.synchronised_tracker import SynchronisedTracker

    if not source.exists():
        refuse(f"{source} does not exist")
    for option, file in (("--output", out), ("--json", json_file), ("--lay", lay)):
        check_output_file(file, option, force=force)
    with refused(OSError, ValueError):
        belief = PoseBelief(
            position=camera_position_sigma_mm * MILLIMETRE,
            tilt=camera_tilt_sigma_mrad * MILLIRADIAN,
        )
        wound, assumed = tracked_condition(typed)
        where = typed_record(CameraPlacement, placement, spelled)
        sought = typed_record(MarkerParameters, markers, spelled)
        read = typed_record(CameraPixels, pixels, spelled)
        config = TrackerConfig.of(wound.resolved(), where, sought, row_time=read.row_time)
        brought = read_bag(source) if is_bag(source) else Recording(camera=None, motion=None)
        lens = read_camera(camera) if camera else brought.camera
        drive = read_motion(motion) if motion else brought.motion
        if lens is None:
            refuse("there is no camera: give --camera")
        if drive is None:
            refuse("there is no motion: give --motion")
        wanted = typed_record(CameraClockParameters, clock, spelled)
        settings = ClockSettings(
            correct=wanted.camera_clock_correction, limit=wanted.camera_clock_limit
        )
        follower = LayFollower(belief)
        live = SynchronisedTracker(
            settings,
            EncoderHistory(longest_gap=math.inf, complete=True),
            beside=follower.take if lay is not None else None,
        )
        tracker = Tracker(config, lens)
        live.start(tracker)
        reader = PixelReader(encoding=read.encoding, significant_bits=read.significant_bits)
        frames = FrameSource(source, fps=fps, reader=reader)
        with busy("tracking") as show:
            rows = []
            for row in _measure(live, frames, drive, settings.limit):
                rows.append(row)
                show(description=f"tracking, {len(rows)} frames")
    with staged(out) as place:
        write_measurements(place, rows)
    if lay is not None and follower.lay is not None:
        with staged(lay) as place:
            write_lay(place, follower.lay.report())
    with busy("refining the camera's pose"):
        fit, unrefined = _refined(tracker, lens, belief) if refined else (None, "")
    estimates = tracker.estimates()
    report = live.report()
    assert report is not None
    result = TrackedRecording(
        report=report,
        means={name: estimates[name] for name in COLUMNS},
        radius=tracker.config.centreline_radius,
        fit=fit,
        unrefined=unrefined,
        clock=live.clock,
        lay=None if follower.lay is None else follower.lay.report(),
        remarks=(*assumed, *frames.remarks()),
    )
    for item in result.shown():
        result_console().print(item, soft_wrap=isinstance(item, str))
    write_json(json_file, result.record())
    if not report.known:
        refuse(f"no marker was found: {report.colour_refusal or 'nothing moved with P0'}", FAILED)


def tracked_condition(typed: Typed) -> tuple[Condition, tuple[str, ...]]:
    """Return what is wound, and a remark if that was not given.

    Where cable lies is measured: without a tension it is expected as long as it was made.
    """
    own = {"cylinder_diameter_mm", "cable_diameter_mm", "marker_spacing_mm"}
    if own & typed.keys() and not {"case", "tension_n", "tension_mpa"} & typed.keys():
        typed = {"tension_n": _UNLOADED, **typed}
    wound = Condition.from_typed(typed, spelling=spelled, case=Condition.case)
    if "case" in typed or not wound.case:
        return wound, ()
    return wound, (f"no cylinder and cable are given: those of case {wound.case} are assumed",)


def _refined(
    tracker: Tracker, lens: PinholeCamera, belief: PoseBelief
) -> tuple[Refinement | None, str]:
    """Return the fit over the run, or why there is none."""
    from marker_tracker_node import refine

    try:
        return refine(tracker.config, lens, tracker.sightings(), belief), ""
    except ValueError as error:
        return None, str(error)


def _measure(
    live: SynchronisedTracker,
    frames: Iterable[tuple[float, NDArray[np.uint8]]],
    motion: Motion,
    ahead: float,
) -> Iterator[tuple[float, Markers]]:
    """Yield the markers of every frame; readings come as far ahead of it as clocks may differ."""
    readings = deque(zip(motion.t, motion.cylinder_angle, motion.guide_z, strict=True))
    for t, frame in frames:
        while readings and readings[0][0] <= t + ahead:
            at, angle, guide = readings.popleft()
            live.add_reading(at, AxisReading.of_positions(angle, guide))
        live.add_frame(t, frame)
        yield from live.measured(final=True)


# Of a marker in run means and refinement: [rad], [m] and their standard deviations.
COLUMNS = ("theta", "z", "sigma_theta", "sigma_z")


@dataclass(frozen=True, kw_only=True)
class TrackedRecording:
    """A recording that has been tracked."""

    report: TrackerReport  # Of the tracker on itself
    # Run means: theta [rad], z [m] and their deviations, shape (markers,) each.
    means: dict[str, NDArray[np.float64]]
    radius: float  # Of the laid cable's centreline [m]
    fit: Refinement | None  # Markers and camera fitted over the run
    unrefined: str  # Why there is no fit; empty if there is one or none was wanted
    clock: CameraClock | None  # The camera's against the encoder's
    lay: LayReport | None  # Every turn of cable, where that was wanted
    remarks: tuple[str, ...]  # On the recording

    def shown(self) -> Iterator[str | Table]:
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
        if not report.judged and report.known > 1:
            yield "not healthy: the first pass of a marker has not been judged"
        if self.unrefined:
            yield f"not refined: {self.unrefined}"
        if self.fit is not None:
            yield f"refined: {self.fit.residual:.2f} px, {_pose_change(self.fit)}"
        columns = _columns("", "mean")
        if self.fit is not None:
            columns += _columns("refined ", "refined")
        marker = Shown("marker", marker_name)
        yield record_table((marker, *columns), self._markers(), words=len(columns) + 1)
        yield from self._clock_sentences()
        yield from self._lay_sentences()

    def record(self) -> dict[str, Any]:
        """Return the same as plain values, None for what is not known."""
        report = self.report
        return {
            **json_values(report, "healthy", "frames"),
            "rejected": {
                fault.name.lower(): count for fault, count in report.rejected.items() if count
            },
            "known": report.known,
            "markers": self._markers(),
            "contradictions": [
                json_values(item, "number", "share", "sigma", "alternatives", "sentence")
                for item in report.contradictions
            ],
            "doubts": list(report.doubts),
            "remarks": [*self.remarks, *report.remarks],
            "refinement": self._fit_record(),
            "camera_clock": self._clock_record(),
            "lay": self._lay_record(),
        }

    def _markers(self) -> list[dict[str, Any]]:
        fit = None if self.fit is None else {name: getattr(self.fit, name) for name in COLUMNS}
        return [
            {
                "id": n,
                "mean": self._marker(self.means, n),
                "refined": None if fit is None else self._marker(fit, n),
            }
            for n in range(len(self.means["theta"]))
        ]

    def _marker(self, values: dict[str, NDArray[np.float64]], n: int) -> dict[str, Any] | None:
        theta, z, sigma_theta, sigma_z = (float(values[name][n]) for name in COLUMNS)
        if not math.isfinite(theta):
            return None
        return {
            "theta_rad": theta,
            "z_m": z,
            "s_m": float(curve_length(self.radius, theta, z)),
            "sigma_theta_rad": known(sigma_theta),
            "sigma_z_m": known(sigma_z),
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
        measured = math.isfinite(estimate.error)
        return {
            "offset_s": estimate.offset if measured else None,
            "error_s": known(estimate.error),
            "corrected": self.clock.applied,
            "remarks": [text for text in (self.clock.refusal, self.clock.warning) if text],
        }

    def _lay_record(self) -> dict[str, Any] | None:
        lay = self.lay
        if lay is None:
            return None
        return {
            "places": len(lay.records),
            "turns": len(set(lay.records["turn"].tolist())),
            **json_values(lay, "free_length_m", "sigma_free_length_m"),
            "defects": [
                {"kind": name_of(item.flag), "first_rad": item.first, "last_rad": item.last}
                for item in lay.defects
            ],
        }

    def _clock_sentences(self) -> Iterator[str]:
        if self.clock is None:
            return
        values = self.clock.values()
        yield (
            f"camera clock: {values['camera_clock_offset_ms']} ms ahead of the encoder's, error "
            f"{values['camera_clock_offset_error_ms']} ms, "
            f"{'corrected' if self.clock.applied else 'not corrected'}"
        )
        yield from filter(None, (self.clock.refusal, self.clock.warning))

    def _lay_sentences(self) -> Iterator[str]:
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


def _columns(what: str, key: str) -> tuple[Shown, ...]:
    """Return the columns of a marker's place in a record, its mean or refined one."""

    def measured(name: str, form: str, unit: float = 1.0) -> Callable[[Any], str | None]:
        def text(marker: Any) -> str | None:
            place = marker[key]
            if place is None:
                return None
            sigma = math.nan if place[f"sigma_{name}"] is None else place[f"sigma_{name}"]
            return f"{place[name] / unit:{form}} ± {sigma / unit:{form}}"

        return text

    return (
        Shown(f"{what}theta, rad", measured("theta_rad", ".4f")),
        Shown(f"{what}z, mm", measured("z_m", ".3f", MILLIMETRE)),
        Shown(f"{what}S, mm", lambda marker: (marker[key] or {}).get("s_m"), ".2f", MILLIMETRE),
    )


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
