"""From what a run is to what its graph is configured with; what cannot be had is refused."""

from __future__ import annotations

import math
import socket
import sys
import time
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cable_fem_node.winding.winding_config import SolverParameters
from winding_cli.run.wanted_lay import controlled_nodes, lead_of
from winding_cli.terminal.output_path import check_output_file, check_output_folder
from winding_cli.terminal.record_options import Typed, spelled
from winding_cli.terminal.refusal import refuse, refused
from winding_cli.terminal.ros_environment import refuse_open
from winding_core.machine.axes import MachineAxes
from winding_core.machine.camera_source import CameraSource
from winding_core.parameters import ParameterError, build, declarations, typed_values
from winding_core.run_options import BY_MOTION, CameraPlacement, SimulatedMachine
from winding_core.run_spec import RunSpec

if TYPE_CHECKING:
    from winding_supervisor.machines.external_machine import ExternalMachineConfig
    from winding_supervisor.session.run_config import RunConfig


def configured(spec: RunSpec, notes: Mapping[str, str]) -> RunConfig:
    """Return what the graph of a run is configured with.

    Ends the command when something would end the run after its nodes have started.

    Args:
        spec: The run.
        notes: What its recordings say of it beside the parameters, by name.

    Raises:
        ParameterError: A file, a camera, a node's parameter or the page cannot be had.
    """
    from winding_recorder.bags.mcap_file import BagConfig
    from winding_supervisor.session.run_config import RunConfig

    recording, graph = spec.recording, spec.graph
    what = spec.condition.resolved()
    with spec.source.at("condition:"):
        # Refuses here what the solver's node would refuse only after its start.
        SolverParameters().config_of(what)
    if graph.parameters and not Path(graph.parameters).is_file():
        label = spec.source.label("parameters")
        raise ParameterError(f"{label}: there is no file {graph.parameters}")
    if graph.secure:
        refuse_open(
            graph.namespace,
            page=spec.page.dashboard,
            external=spec.external,
            camera=spec.camera.camera,
            control=spec.controlled,
        )
    label = f"case{what.case.number:02d}" if what.case.number else "own"
    stated = {"case": spec.condition.case, "duration": spec.condition.duration}
    config = RunConfig(
        directory=Path(recording.output or f"runs/{time.strftime('%Y%m%d-%H%M%S')}-{label}"),
        numbered=not recording.output,
        condition={**spec.asked("condition"), **stated},
        machine=_external_machine(spec),
        own=_own_parameters(spec),
        duration=what.duration,
        bag=path_of(recording.bag),
        recording=BagConfig(compression=recording.compression, split_bytes=round(recording.split)),
        parameters_file=path_of(graph.parameters),
        domain=graph.domain if "domain" in spec.given else None,
        namespace=graph.namespace,
        attach=graph.attach,
        page=_page_parameters(spec) if spec.page.dashboard else None,
        trace=bool(recording.trace),
        compose=_composed_camera(spec),
        lay_control=spec.controlled,
        notes=notes,
        attended=sys.stdin.isatty(),
    )
    _check_nodes(spec, config)
    _check_outputs(spec)
    return config


def path_of(text: str) -> Path | None:
    """Return the path that an option names; None for an empty text."""
    return Path(text) if text else None


def _own_parameters(spec: RunSpec) -> dict[str, Mapping[str, object]]:
    """Return what single nodes are run with beside the condition."""
    from winding_ros.graph import CORRECTION, RIG, TRACKER, parameters_of

    asked = {**spec.asked("camera"), **spec.asked("tracking"), **spec.asked("correction")}
    own: dict[str, Mapping[str, object]] = {
        node.name: _of(parameters_of(node), asked) for node in (RIG, TRACKER, CORRECTION)
    }
    if spec.external:
        del own[RIG.name]
    else:
        simulated = _of(SimulatedMachine, spec.asked("machine")) | {"lay": spec.simulated_lay}
        if spec.machine.truth_file:
            simulated["truth_file"] = str(Path(spec.machine.truth_file).absolute())
        own[RIG.name] = {**own[RIG.name], **simulated}
        with spec.source.at("lay"):
            build(parameters_of(RIG), {"lay": spec.simulated_lay}, owner="winding run")
    if spec.controlled:
        own[TRACKER.name] = {**own[TRACKER.name], "measure_lay": True}
        own |= controlled_nodes(spec)
    return own


def _of(record: type, values: Mapping[str, object]) -> dict[str, object]:
    names = {item.name for item in declarations(record)}
    return {name: value for name, value in values.items() if name in names}


def _external_machine(spec: RunSpec) -> ExternalMachineConfig | None:
    """Return the external machine that was asked for; None for the simulated one."""
    if not spec.external:
        return None
    from winding_supervisor.machines.external_machine import ExternalMachineConfig

    what, machine = spec.condition.resolved(), spec.machine
    end_angle = float(what.drive.positions(what.duration)[0])
    if machine.turns:
        end_angle = 2.0 * math.pi * machine.turns
    elif machine.wound_length:
        laid = math.hypot(what.case.centreline_radius, what.drive.advance_per_radian)
        end_angle = machine.wound_length * what.case.expected_stretch / laid
    return ExternalMachineConfig(
        axes=MachineAxes(**_of(MachineAxes, spec.asked("machine"))),  # type: ignore[arg-type]
        drive=what.drive,
        end_angle=end_angle,
        camera=spec.camera.camera,
        starts_itself=machine.start == BY_MOTION,
        standing_limit=machine.standing,
        lead=lead_of(spec),
    )


def _composed_camera(spec: RunSpec) -> str:
    """Return what opens a camera in the tracker's process; empty for one that publishes."""
    source = spec.camera.compose
    if source and spec.external:
        # The tracker's process finds modules in the present folder, as `python -m` does.
        sys.path.append(str(Path.cwd()))
        with spec.source.at("compose"):
            CameraSource.parsed(source)
        return source
    from winding_ros.graph import SIMULATED_CAMERA

    return SIMULATED_CAMERA if source else ""


def _check_outputs(spec: RunSpec) -> None:
    recording, label = spec.recording, spec.source.label
    check_output_folder(path_of(recording.bag), label("bag"), new=True)
    check_output_folder(path_of(recording.output), label("output"), new=True)
    check_output_folder(path_of(recording.report), label("report"))
    files = {"json": recording.json, "trace": recording.trace, "truth": spec.machine.truth_file}
    for key, file in files.items():
        check_output_file(path_of(file), label(key), make_folder=True)


def _check_nodes(spec: RunSpec, config: RunConfig) -> None:
    from correction_node.models.weights import load_factor, weights_directory
    from winding_recorder.live.recorder import RecorderError
    from winding_ros import topics
    from winding_supervisor.session.run_config import RunFolderError, check_run

    try:
        check_run(config)
    except RecorderError as error:
        spec.source.refuse("bag", error)
    except RunFolderError as error:
        spec.source.refuse("output", error)
    except ValueError as error:
        spec.source.refuse("parameters", error)
    # They may stand in the user's parameter file.
    if name := config.parameters()[topics.CORRECTION].get("weights"):
        with spec.source.at("weights"):
            load_factor(weights_directory(str(name)))


def machine_axes(typed: Typed) -> MachineAxes:
    """Return the axes that were typed; end the command when they contradict each other."""
    with refused(ParameterError, ValueError):
        return build(MachineAxes, typed_values(MachineAxes, typed, spelled), owner="the machine")


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
            values |= _of(CameraPlacement, parameters_for(file, f"/{namespace}/{TRACKER.name}"))
            own = parameters_for(file, f"/{namespace}/{PAGE.name}")
            values |= _of(parameters_of(PAGE), own)
        values |= _of(CameraPlacement, spec.asked("camera")) | spec.asked("limits")
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
