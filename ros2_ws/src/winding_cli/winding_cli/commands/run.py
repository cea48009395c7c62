"""`winding run`: wind one case through the real graph and report what came out."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from cable_fem_node.winding.winding_config import SolverParameters
from winding_cli.run.configuration import (
    MachineOptions,
    case_label,
    check_camera,
    check_page_and_file,
    composed_camera,
    given,
    lay_of,
    look_of,
    machine_of,
    page_parameters,
    recording_of,
)
from winding_cli.run.wanted_lay import controlled_nodes, lead_of, tolerance_of, wish_of
from winding_cli.terminal.output_path import check_output_file, check_output_folder
from winding_cli.terminal.record_options import (
    PANEL_OF_RUN,
    Domain,
    Namespace,
    Typed,
    spelled,
    with_options,
)
from winding_cli.terminal.refusal import refuse
from winding_cli.terminal.ros_environment import check_namespace, refuse_open
from winding_core.cable.condition import Condition
from winding_core.error_verdict import ErrorLimit
from winding_core.lay.errors import LayTolerance
from winding_core.machine.axes import MachineAxes
from winding_core.markers import MarkerParameters
from winding_core.parameters import build, typed_values
from winding_core.run_options import (
    CameraClockParameters,
    CameraPixels,
    CameraPlacement,
    LayParameters,
    LayWish,
    OperatorLimits,
)


@with_options(
    Condition,
    MachineAxes,
    CameraClockParameters,
    MarkerParameters,
    CameraPlacement,
    CameraPixels,
    LayParameters,
    LayWish,
    LayTolerance,
    ErrorLimit,
    panels=PANEL_OF_RUN,
)
def run(
    typed: Typed,
    axes: Typed,
    clock: Typed,
    markers: Typed,
    placement: Typed,
    pixels: Typed,
    measured: Typed,
    wish: Typed,
    judged: Typed,
    errors: Typed,
    *,
    lay: Annotated[
        str | None,
        typer.Option(
            help="paper: the published measurement; fem: a cable with hidden properties; driven: "
            "what the machine's own motion lays, for runs under commands."
        ),
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option(help="JSON file of where the simulated cable truly lay, and what was hidden."),
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(help="Simulated seconds per second, 1 by default; 0: as fast as all follow."),
    ] = None,
    bag: Annotated[
        Path | None, typer.Option(help="Record every topic into this new rosbag2 folder.")
    ] = None,
    compression: Annotated[str, typer.Option(help="Of MCAP chunks: none or zstd.")] = "none",
    split_mb: Annotated[
        float, typer.Option(help="Begin a further file of the bag after so many MB; 0: never.")
    ] = 2000.0,
    output: Annotated[
        Path | None,
        typer.Option(help="New folder of logs, report and numbers; runs/<time>-case<N> otherwise."),
    ] = None,
    report: Annotated[Path | None, typer.Option(help="Folder of the report.")] = None,
    json: Annotated[Path | None, typer.Option(help="File of the run's numbers.")] = None,
    trace: Annotated[
        Path | None,
        typer.Option(
            help="File of where each corrected length's time went, for Perfetto (Trace Event JSON)."
        ),
    ] = None,
    compose: Annotated[
        str | None,
        typer.Option(
            help="Track frames in the camera's process: camera for the simulated one, or what "
            "opens a real one, MODULE:FUNCTION or FILE.py:FUNCTION."
        ),
    ] = None,
    frame_rate: Annotated[
        int | None, typer.Option(help="Simulated frames per second: 200 or 1000.")
    ] = None,
    camera_noise: Annotated[
        float | None, typer.Option(help="Read noise of the simulated camera in grey levels.")
    ] = None,
    weights: Annotated[
        str | None, typer.Option(help="Trained weight: shipped name or folder.")
    ] = None,
    parameters: Annotated[
        Path | None, typer.Option(help="ROS parameter file for the nodes.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the simulated sensors.")] = None,
    domain: Domain = None,
    namespace: Namespace = "winding",
    dashboard: Annotated[
        bool,
        typer.Option("--dashboard", help="Serve the operator's page and wait for its Start."),
    ] = False,
    dashboard_port: Annotated[
        int | None, typer.Option(help="TCP port of that page; 8080 by default.")
    ] = None,
    machine: Annotated[
        str,
        typer.Option(help="simulated, or external: a driver that runs already."),
    ] = "simulated",
    camera: Annotated[
        bool, typer.Option("--camera/--no-camera", help="Whether an external machine has one.")
    ] = True,
    start: Annotated[
        str,
        typer.Option(
            help="How an external machine begins: service calls rig/start, motion waits for it."
        ),
    ] = "service",
    turns: Annotated[
        float | None,
        typer.Option(help="An external run ends after so many turns; else after the drive's."),
    ] = None,
    wound_length_mm: Annotated[
        float | None,
        typer.Option(help="An external run ends after so much undeformed cable, about."),
    ] = None,
    standing_s: Annotated[
        float, typer.Option(help="An external machine that stands for longer has ended its run.")
    ] = 60.0,
    attach: Annotated[
        bool,
        typer.Option("--attach", help="The nodes run already, such as in containers of their own."),
    ] = False,
    secure: Annotated[
        bool, typer.Option("--secure", help="Refuse to run unless DDS security is enforced.")
    ] = False,
) -> None:
    """Wind one case: predict, measure, correct; end with a table and a report."""
    try:
        condition = Condition.from_typed(
            typed, spelling=spelled, case=Condition.case if dashboard else None
        )
        what = condition.resolved()
        wound = what.case
        # Refuses here what the solver's node would refuse only after its start.
        SolverParameters().config_of(what)
        declared = {"case": condition.case, "duration": condition.duration}
        values: dict[str, object] = {**typed_values(Condition, typed), **declared}
        tracker = {
            **typed_values(CameraClockParameters, clock, spelled),
            **typed_values(MarkerParameters, markers, spelled),
            **(where := typed_values(CameraPlacement, placement, spelled)),
            **typed_values(CameraPixels, pixels, spelled),
            **typed_values(LayParameters, measured, spelled),
        }
        look = look_of(markers)
        wished = wish_of(wish, condition)
        tolerance = tolerance_of(judged, wished)
        limit = build(ErrorLimit, typed_values(ErrorLimit, errors, spelled), owner="winding run")
    except ValueError as error:
        refuse(error)
    check_namespace(namespace)
    check_page_and_file(dashboard, dashboard_port, parameters)
    recording = recording_of(compression, split_mb)
    external = machine_of(
        machine,
        axes,
        what,
        MachineOptions(
            camera=camera,
            start=start,
            turns=turns,
            wound_length_mm=wound_length_mm,
            standing_s=standing_s,
            lead=lead_of(wished, condition),
        ),
        simulated={
            "speed": speed,
            "lay": lay,
            "truth": truth,
            "seed": seed,
            "frame-rate": frame_rate,
            "camera-noise": camera_noise,
        },
    )
    check_camera(
        external=external is not None,
        camera=camera,
        composed=compose not in (None, "camera"),
        frame_rate=frame_rate,
        pixels=pixels,
        others=(clock, placement, measured),
    )
    camera_source = composed_camera(compose, external, attach=attach, secure=secure)
    if secure:
        refuse_open(
            namespace,
            page=dashboard,
            external=external is not None,
            camera=camera,
            control=bool(wished),
        )
    lay = lay_of(lay, published=wound.is_published, composed=bool(camera_source), wish=wished)
    from winding_cli.run.delivery import DeliveryOptions, RunDelivery
    from winding_cli.run.winding import wind
    from winding_cli.terminal.origin import origin_here
    from winding_recorder.bags.description import ORIGIN
    from winding_ros import topics
    from winding_supervisor.session.run_config import RunConfig

    origin = origin_here()
    simulated = given(
        speed=speed,
        lay=lay,
        seed=seed,
        frame_rate=frame_rate,
        camera_noise=camera_noise,
        truth_file=None if truth is None else str(truth.absolute()),
    )
    config = RunConfig(
        directory=output
        or Path("runs") / f"{time.strftime('%Y%m%d-%H%M%S')}-{case_label(wound.number)}",
        numbered=output is None,
        condition=values,
        machine=external,
        own={
            **({} if external else {topics.RIG: look | simulated}),
            topics.TRACKER: tracker | ({"measure_lay": True} if wished else {}),
            topics.CORRECTION: given(weights=weights),
            **(controlled_nodes(wished) if wished else {}),
        },
        duration=condition.duration,
        bag=bag,
        recording=recording,
        parameters_file=parameters,
        domain=domain,
        namespace=namespace,
        attach=attach,
        page=page_parameters(
            dashboard_port,
            parameters,
            namespace,
            where | tolerance.of_page | {"error_limit_pct": limit.error_limit_pct},
        )
        if dashboard
        else None,
        trace=trace is not None,
        compose=camera_source,
        lay_control=bool(wished),
        notes={ORIGIN: origin.text},
    )
    check_output_folder(report, "--report")
    for option, file in (("--json", json), ("--trace", trace), ("--truth", truth)):
        check_output_file(file, option, make_folder=True)
    delivery = RunDelivery(
        config,
        condition,
        origin,
        DeliveryOptions(
            report=report,
            json=json,
            trace=trace,
            wish=wished,
            limits=OperatorLimits(
                lay_tolerance=tolerance.limit, error_limit_pct=limit.error_limit_pct
            ),
            lay_held=tolerance.asked,
            errors_held=bool(errors),
        ),
    )
    failure = wind(config, condition, delivery)
    if failure is not None:
        failure()
    delivery.end()
