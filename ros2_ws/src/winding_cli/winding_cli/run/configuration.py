"""From what a run is to what its graph is configured with; what cannot be had is refused."""

from __future__ import annotations

import math
import socket
import sys
import time
from collections.abc import Mapping
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cable_fem_node.dynamics.state import SolverError
from cable_fem_node.ros.parameters import FemParameters
from cable_fem_node.winding.expected_cost import falling_behind
from cable_fem_node.winding.winding_config import SolverParameters
from winding_cli.terminal.console import busy
from winding_cli.terminal.output_path import STANDARD_OUTPUT, check_output_file, check_output_folder
from winding_cli.terminal.refusal import refuse
from winding_core.lay.guide_path import lay_of_drive
from winding_core.machine.axes import MachineAxes
from winding_core.machine.camera_source import CameraSource
from winding_core.parameters import ParameterError, build, declared_in
from winding_core.run_options import BY_MOTION, CameraPlacement
from winding_core.run_spec import RunSpec
from winding_ros import topics
from winding_ros.topics import FEM

if TYPE_CHECKING:
    from winding_supervisor.machines.external_machine import ExternalMachineConfig
    from winding_supervisor.session.run_config import RunConfig


def configured(spec: RunSpec, notes: Mapping[str, str]) -> RunConfig:
    """Return what the graph of a run is configured with.

    Ends the command when something would end the run after its nodes have started.

    Args:
        spec: The run.
        notes: What its recordings state of it beside the parameters, by name.

    Raises:
        ParameterError: A file, a camera, a node's parameter or the page cannot be had.
        SecurityError: A node is not held to its policy.
    """
    from winding_ros.access_policy import Participants
    from winding_ros.graph import RIG, members, parameters_of
    from winding_ros.security import check_security
    from winding_supervisor.session.run_config import RunConfig

    graph = spec.graph
    what = spec.condition.resolved()
    with spec.source.at("condition:"):
        # Refuses here what the solver's node would refuse only after its start.
        build(SolverParameters, spec.asked("solver"), owner="winding run").config_of(what)
    if graph.parameters and not Path(graph.parameters).is_file():
        label = spec.source.label("parameters")
        raise ParameterError(f"{label}: there is no file {graph.parameters}")
    if graph.secure:
        nodes = members(external=spec.external, camera=spec.camera.camera, control=spec.controlled)
        # Their policies, and that of the page where there is one.
        taking_part = Participants(graph=nodes, page=spec.page.dashboard)
        check_security(graph.namespace, taking_part=taking_part)
    machine = _external_machine(spec) if spec.external else None
    if machine is None:
        with spec.source.at("lay"):
            build(parameters_of(RIG), {"lay": spec.simulated_lay}, owner="winding run")
        lead_of(spec)
    _check_drum(spec)
    _check_arm(spec)
    page = _page_parameters(spec) if spec.page.dashboard else None
    _check_camera(spec)
    label = f"case{what.case.number:02d}" if what.case.number else "own"
    config = RunConfig(
        spec=spec,
        directory=spec.path("output") or Path(f"runs/{time.strftime('%Y%m%d-%H%M%S')}-{label}"),
        machine=machine,
        page=page,
        notes=notes,
        attended=sys.stdin.isatty(),
    )
    _check_nodes(spec, config)
    _check_outputs(spec)
    return config


def _external_machine(spec: RunSpec) -> ExternalMachineConfig:
    """Return the external machine that was asked for."""
    from winding_supervisor.machines.external_machine import ExternalMachineConfig

    what, machine = spec.condition.resolved(), spec.machine
    end_angle = float(what.drive.positions(what.duration)[0])
    if machine.turns:
        end_angle = 2.0 * math.pi * machine.turns
    elif machine.wound_length:
        laid = math.hypot(what.case.centreline_radius, what.drive.advance_per_radian)
        end_angle = machine.wound_length * what.case.expected_stretch / laid
    return ExternalMachineConfig(
        axes=MachineAxes(**declared_in(MachineAxes, spec.asked("machine"))),
        drive=what.drive,
        end_angle=end_angle,
        camera=spec.camera.camera,
        starts_itself=machine.start == BY_MOTION,
        standing_limit=machine.standing,
        lead=lead_of(spec),
    )


def lead_of(spec: RunSpec) -> float:
    """Return by how much the guide of a wanted lay goes ahead of the cable at first [m].

    Raises:
        ParameterError: No controller can lay what is wanted.
    """
    if not spec.controlled:
        return 0.0
    try:
        controller = _wish(spec).new_controller()
    except ValueError as error:
        if spec.lay.program:
            raise ParameterError(f"{spec.source.label('program')}: {error}") from error
        spec.source.refuse("lay:", error)
    what = spec.condition.resolved()
    slope: float = controller.wanted.at(0.0).slope
    return slope * what.free_length / what.case.centreline_radius


def _check_drum(spec: RunSpec) -> None:
    """Refuse a motion that would lay cable beside the drum; that of a real machine is its own."""
    what = spec.condition.resolved()
    drum, driving = spec.drum.drum(what.case), spec.controlled and spec.lay.control == "drive"
    if drum is None or (spec.external and not driving):
        return
    theta, z = lay_of_drive(what)
    if driving:
        z = _wish(spec).wanted(what).z_at(theta)
    with spec.source.at("drum:"):
        drum.refuse_beyond(theta, z, what.case.cable_diameter)


def _check_arm(spec: RunSpec) -> None:
    """Refuse an arm that cannot be used, and a motion on which it cannot lead the guide."""
    from winding_core.arm.opening import check_arm
    from winding_ros.graph import RIG, parameters_of

    file, what = spec.machine.machine_file, spec.condition.resolved()
    if not file:
        return
    places, rise = np.array([what.drive.positions(what.duration)[1]]), what.drive.advance_per_radian
    if spec.controlled and spec.lay.control == "drive":
        theta, _ = lay_of_drive(what)
        z = _wish(spec).wanted(what).z_at(theta)
        slopes = np.gradient(z, theta)
        places = z + what.free_length / what.case.centreline_radius * slopes
        rise = float(np.abs(slopes).max())
    with spec.source.at("machine_file"):
        values = {**asdict(spec.condition), "lay": spec.simulated_lay, "machine_file": file}
        rig: Any = build(parameters_of(RIG), values, owner="winding run")
        check_arm(rig.arm_path(), what, places, rise * what.drive.angular_speed)


def _wish(spec: RunSpec) -> Any:
    """Return the parameters of the controller of the wanted lay."""
    from lay_control_node.ros.parameters import LayControlParameters

    values = {**asdict(spec.condition), **spec.wish}
    return build(LayControlParameters, values, owner="winding run")


def _check_camera(spec: RunSpec) -> None:
    """Refuse a camera that the tracker's process could not open."""
    if spec.camera.compose and spec.external:
        # It finds modules in the present folder, as `python -m` does.
        sys.path.append(str(Path.cwd()))
        with spec.source.at("compose"):
            CameraSource.parsed(spec.camera.compose)


def _check_outputs(spec: RunSpec) -> None:
    label = spec.source.label
    for key in ("bag", "output", "report"):
        check_output_folder(spec.path(key), label(key), new=key != "report")
    for key in ("json", "trace", "truth"):
        path = spec.path(key)
        if key != "json" or path != STANDARD_OUTPUT:
            check_output_file(path, label(key), make_folder=True)


def _check_nodes(spec: RunSpec, config: RunConfig) -> None:
    from correction_node.models.weights import load_factor, weights_directory
    from winding_recorder.live.recorder import RecorderError
    from winding_ros.graph import FEM, parameters_of
    from winding_supervisor.session.run_config import RunFolderError, check_run

    try:
        check_run(config)
    except RecorderError as error:
        spec.source.refuse("bag", error)
    except RunFolderError as error:
        spec.source.refuse("output", error)
    except ValueError as error:
        spec.source.refuse("parameters", error)
    # They may stand in the user's parameter file, and so may the element.
    fem: Any = build(parameters_of(FEM), config.parameters()[FEM.name], owner=FEM.name)
    with spec.source.at("solver:"):
        fem.in_step()
    if spec.external and fem.element != "rod":
        spec.source.refuse(
            "element",
            f"an external machine cannot wait for element {fem.element}, which needs several "
            "seconds for each of the run: take element rod",
        )
    if name := config.parameters()[topics.CORRECTION].get("weights"):
        with spec.source.at("weights"):
            load_factor(weights_directory(str(name)))


def _page_parameters(spec: RunSpec) -> dict[str, object]:
    """Return the page's parameters, from the user's file and the run; refuse a taken port."""
    from winding_ros.graph import PAGE, TRACKER, parameters_of
    from winding_ros.runtime.parameter_files import parameters_for

    if find_spec("uvicorn") is None:
        refuse("the page needs its web server: pip install cable-winding-twin[dashboard]")
    values: dict[str, object] = {}
    with spec.source.at("parameters"):
        if spec.graph.parameters:
            file, namespace = Path(spec.graph.parameters), spec.graph.namespace
            # The page draws frames where the tracker's camera stands.
            tracker = parameters_for(file, f"/{namespace}/{TRACKER.name}")
            values |= declared_in(CameraPlacement, tracker)
            own = parameters_for(file, f"/{namespace}/{PAGE.name}")
            values |= declared_in(parameters_of(PAGE), own)
        values |= declared_in(CameraPlacement, spec.asked("camera")) | spec.asked("limits")
        if spec.machine.machine_file:
            values["machine_file"] = str(Path(spec.machine.machine_file).absolute())
        if "dashboard_port" in spec.given:
            values["port"] = spec.page.dashboard_port
        page: Any = build(parameters_of(PAGE), values, owner=PAGE.name)
        page.check()
    with spec.source.at("dashboard_port"):
        _refuse_taken(page.host, page.port)
    return values | {"host": page.host, "port": page.port}


def _refuse_taken(host: str, port: int) -> None:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family) as probe:
        # As the web server does: a port that was served a moment ago may be served again.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise ParameterError(
                f"the page cannot be served on {host}, port {port}: {error.strerror}; "
                "choose another with --dashboard-port"
            ) from error


def warn_of_slowness(config: RunConfig) -> None:
    """Print on stderr when the solver may fall behind, with a mass scaling that helps.

    A simulated machine that follows its slowest consumer waits for it.
    """
    spec = config.spec
    pace = 1.0 if spec.external else spec.machine.speed
    values = config.parameters().get(FEM)
    if values is None or not pace:
        return
    wanted: Any = build(FemParameters, values, owner=FEM)
    if wanted.element != "rod":
        # Simulated time waits for the solid.
        return
    with busy("estimating the time"):
        try:
            sentence = falling_behind(wanted.in_step(), time.process_time, pace=pace)
        except (SolverError, ValueError):
            # The node refuses it as it is configured, with the same sentence.
            return
    if sentence:
        print(f"doubtful: {sentence}", file=sys.stderr, flush=True)
