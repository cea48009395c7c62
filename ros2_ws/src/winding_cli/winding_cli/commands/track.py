"""`winding track`: measure the markers of a recorded run, without ROS."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from winding_cli.commands.condition_options import Typed, spelled, with_options
from winding_cli.commands.console import result_console
from winding_cli.commands.output_path import check_output_file, staged, write_json
from winding_cli.commands.refusal import FAILED, refuse, refused
from winding_cli.output.tracking import COLUMNS, TrackedRecording
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

    from marker_tracker_node import (
        PinholeCamera,
        PoseBelief,
        Refinement,
        Tracker,
    )
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
    json_file: Annotated[
        Path | None, typer.Option("--json", help="Also write what was found to this file.")
    ] = None,
    lay: Annotated[
        Path | None, typer.Option(help="CSV of every turn on the cylinder, every 5 degrees.")
    ] = None,
    refined: Annotated[
        bool, typer.Option("--refine/--no-refine", help="Fit the camera's pose over the run.")
    ] = True,
    camera_position_sigma_mm: Annotated[
        float,
        typer.Option(min=0.0, help="Standard deviation of its position; a tape measure's."),
    ] = 2.0,
    camera_tilt_sigma_mrad: Annotated[
        float,
        typer.Option(min=0.0, help="Standard deviation of its direction; a spirit level's."),
    ] = 10.0,
) -> None:
    """Track a recording and print where every marker lies."""
    from marker_tracker_node import PoseBelief, Tracker
    from marker_tracker_node.camera.calibration import read_camera
    from marker_tracker_node.camera.frame_sources import FrameSource, Recording, is_bag, read_bag
    from marker_tracker_node.camera.recordings import read_motion, write_measurements
    from marker_tracker_node.lay.lay_follower import LayFollower, write_lay
    from marker_tracker_node.tracking.checks.camera_clock import ClockSettings
    from marker_tracker_node.tracking.config import TrackerConfig
    from marker_tracker_node.tracking.encoder_history import EncoderHistory
    from marker_tracker_node.tracking.synchronised_tracker import SynchronisedTracker

    if not source.exists():
        refuse(f"{source} does not exist")
    for option, file in (("--output", out), ("--json", json_file), ("--lay", lay)):
        check_output_file(file, option)
    with refused(OSError, ValueError):
        belief = PoseBelief(
            position=camera_position_sigma_mm * MILLIMETRE,
            tilt=camera_tilt_sigma_mrad * MILLIRADIAN,
        )
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
        follower = LayFollower(belief)
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
    fit, unrefined = _refined(tracker, lens, belief) if refined else (None, "")
    estimates = tracker.estimates()
    result = TrackedRecording(
        report=tracker.report(),
        means={name: estimates[name] for name in COLUMNS},
        radius=tracker.config.centreline_radius,
        fit=fit,
        unrefined=unrefined,
        clock=live.clock,
        lay=None if follower.lay is None else follower.lay.report(),
        remarks=tuple(frames.remarks()),
    )
    for said in result.said():
        result_console().print(said, soft_wrap=isinstance(said, str))
    if json_file is not None:
        write_json(json_file, result.record())
    report = tracker.report()
    if not report.known:
        refuse(f"no marker was found: {report.colour_refusal or 'nothing moved with P0'}", FAILED)


def _refined(
    tracker: Tracker, lens: PinholeCamera, belief: PoseBelief
) -> tuple[Refinement | None, str]:
    """Return the fit over the run, or why there is none."""
    from marker_tracker_node import refine

    try:
        return refine(tracker.config, lens, tracker.sightings(), belief), ""
    except ValueError as error:
        return None, str(error)


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
