"""`winding track`: measure the markers of a recorded run, without ROS."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer
from rich.table import Table

from winding_cli.commands.condition_options import Typed, spelled, with_options
from winding_cli.commands.console import result_console
from winding_cli.commands.output_path import check_output_file, staged
from winding_cli.commands.refusal import FAILED, refuse, refused
from winding_core.camera_clock import CameraClockParameters
from winding_core.camera_pixels import CameraPixels
from winding_core.camera_placement import CameraPlacement
from winding_core.condition import Condition
from winding_core.image_formats import PixelReader
from winding_core.marker_parameters import MarkerParameters
from winding_core.options import typed_values
from winding_core.parameters import build
from winding_core.readings import AxisReading
from winding_core.units import MILLIMETRE, MILLIRADIAN

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from marker_tracker_node import LayReport, PinholeCamera, Tracker
    from marker_tracker_node.camera.recordings import Motion
    from marker_tracker_node.tracking.synchronised_tracker import SynchronisedTracker
    from winding_core.markers import Markers

Record = TypeVar("Record")


@with_options(Condition, CameraClockParameters, CameraPlacement, MarkerParameters, CameraPixels)
def track(
    typed: Typed,
    clock: Typed,
    placement: Typed,
    markers: Typed,
    pixels: Typed,
    *,
    source: Annotated[Path, typer.Argument(help="Video file, folder of pictures, or bag.")],
    out: Annotated[Path, typer.Option(help="CSV of every frame's markers.")],
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
    lay: Annotated[
        Path | None, typer.Option(help="CSV of every turn on the cylinder, every 5 degrees.")
    ] = None,
    refined: Annotated[
        bool, typer.Option("--refine/--no-refine", help="Fit the camera's pose over the run.")
    ] = True,
) -> None:
    """Track a recording and print where every marker lies."""
    from marker_tracker_node import Tracker
    from marker_tracker_node.camera.bags import Recording, is_bag, read_bag
    from marker_tracker_node.camera.calibration import read_camera
    from marker_tracker_node.camera.frame_sources import FrameSource
    from marker_tracker_node.camera.recordings import read_motion, write_measurements
    from marker_tracker_node.lay.lay_follower import LayFollower, write_lay
    from marker_tracker_node.tracking.camera_clock import ClockSettings
    from marker_tracker_node.tracking.config import TrackerConfig
    from marker_tracker_node.tracking.encoder_history import EncoderHistory
    from marker_tracker_node.tracking.synchronised_tracker import SynchronisedTracker

    if not source.exists():
        refuse(f"{source} does not exist")
    check_output_file(out)
    if lay is not None:
        check_output_file(lay)
    with refused(OSError, ValueError):
        wound = Condition.from_typed(typed, spelling=spelled, case=Condition.case)
        where = _built(CameraPlacement, placement)
        sought, read = _built(MarkerParameters, markers), _built(CameraPixels, pixels)
        config = TrackerConfig.of(wound.resolved(), where, sought, row_time=read.row_time)
        brought = read_bag(source) if is_bag(source) else Recording(camera=None, motion=None)
        lens = read_camera(camera) if camera else brought.camera
        drive = read_motion(motion) if motion else brought.motion
        if lens is None:
            refuse("there is no camera: give --camera")
        if drive is None:
            refuse("there is no motion: give --motion")
        wanted = _built(CameraClockParameters, clock)
        settings = ClockSettings(
            correct=wanted.camera_clock_correction, limit=wanted.camera_clock_limit
        )
        follower = LayFollower()
        live = SynchronisedTracker(
            settings,
            EncoderHistory(longest_gap=math.inf, complete=True),
            beside=follower.take if lay is not None else None,
        )
        tracker = Tracker(config, lens, remember=refined)
        live.start(tracker)
        reader = PixelReader(encoding=read.encoding, significant_bits=read.significant_bits)
        frames = FrameSource(source, fps=fps, reader=reader)
        rows = list(_measure(live, frames, drive, settings.limit))
    with staged(out) as place:
        write_measurements(place, rows)
    if lay is not None and follower.lay is not None:
        with staged(lay) as place:
            write_lay(place, follower.lay.report())
    for sentence in (*frames.remarks(), *tracker.report().remarks):
        result_console().print(sentence, soft_wrap=True)
    _print(tracker, lens, refined)
    _print_clock(live)
    if follower.lay is not None:
        _print_lay(follower.lay.report())
    report = tracker.report()
    if not report.known:
        refuse(f"no marker was found: {report.colour_refusal or 'nothing moved with P0'}", FAILED)


def _built(record: type[Record], typed: Typed) -> Record:
    return build(record, typed_values(record, typed, spelled), owner="winding track")


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
            live.add_reading(
                at,
                AxisReading(
                    cylinder_angle=angle,
                    angular_speed=math.nan,
                    carriage_position=guide,
                    feed_speed=math.nan,
                ),
            )
        live.add_frame(t, frame)
        yield from live.measured(final=True)


def _print_clock(live: SynchronisedTracker) -> None:
    clock = live.clock
    if clock is None:
        return
    told = clock.values()
    console = result_console()
    console.print(
        f"camera clock: {told['camera_clock_offset_ms']} ms ahead of the encoder's, error "
        f"{told['camera_clock_offset_error_ms']} ms, "
        f"{'corrected' if clock.applied else 'not corrected'}"
    )
    for sentence in filter(None, (clock.refusal, clock.warning)):
        console.print(sentence)


def _print_lay(report: LayReport) -> None:
    from winding_core.lay_records import name_of

    console, records = result_console(), report.records
    turns = len(set(records["turn"].tolist()))
    console.print(f"lay: {len(records)} places of {turns} turns")
    if math.isfinite(report.free_length):
        length, error = (x / MILLIMETRE for x in (report.free_length, report.sigma_free_length))
        console.print(f"free length: {length:.1f} mm, error {error:.1f} mm")
    for defect in report.defects:
        where = f"{defect.first:.2f} to {defect.last:.2f} rad"
        console.print(f"{name_of(defect.flag)}: {where}", soft_wrap=True)


def _print(tracker: Tracker, lens: PinholeCamera, refined: bool) -> None:
    from marker_tracker_node import refine
    from winding_core.helix import curve_length

    console = result_console()
    report = tracker.report()
    refused = sum(report.rejected.values())
    console.print(f"{report.frames} frames used, {refused} refused, {report.known} markers known")
    for fault, count in report.rejected.items():
        if count:
            console.print(f"  {count} x {fault.value}")
    for item in report.contradictions:
        console.print(f"the pictures contradict: {item.sentence}")
    estimates = tracker.estimates()
    theta, z = estimates["theta"], estimates["z"]
    if refined:
        try:
            fit = refine(tracker.config, lens, tracker.sightings())
        except ValueError as error:
            console.print(f"not refined: {error}")
        else:
            theta, z = fit.theta, fit.z
            tilt = ", ".join(f"{angle / MILLIRADIAN:.2f}" for angle in fit.pose.tilt)
            console.print(f"refined: {fit.residual:.2f} px, camera tilt ({tilt}) mrad")
    table = Table("marker", "theta, rad", "z, mm", "S, mm")
    length = curve_length(tracker.config.centreline_radius, theta, z)
    for n, (angle, height, s) in enumerate(zip(theta, z, length, strict=True)):
        numbers = (f"{angle:.4f}", f"{height / MILLIMETRE:.3f}", f"{s / MILLIMETRE:.2f}")
        table.add_row(f"P{n}", *(numbers if math.isfinite(s) else ("-", "-", "-")))
    console.print(table)
