"""From what was typed to what a run is configured with; what cannot be is refused."""

from __future__ import annotations

import dataclasses
import math
import socket
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from winding_cli.terminal.output_path import check_output_folder
from winding_cli.terminal.record_options import Typed, spelled
from winding_cli.terminal.refusal import refuse, refused
from winding_core.cable.condition import ResolvedCondition
from winding_core.machine.axes import MachineAxes
from winding_core.markers import MarkerLook
from winding_core.parameters import (
    ParameterError,
    Value,
    build,
    declarations,
    options,
    typed_values,
)
from winding_core.units import MEGABYTE, MILLIMETRE

if TYPE_CHECKING:
    from winding_recorder.bags.mcap_file import BagConfig
    from winding_supervisor.machines.external_machine import ExternalMachineConfig
    from winding_supervisor.session.run_config import RunConfig

SIMULATED, EXTERNAL = "simulated", "external"
_TRACKER, _PAGE = "marker_tracker", "dashboard"
# The page draws frames where the tracker's camera stands.
_CAMERA = ("camera_position", "camera_tilt")


def given(**values: object) -> dict[str, object]:
    """Return the values that were given, without those that were left open."""
    return {name: value for name, value in values.items() if value is not None}


def case_label(case: int) -> str:
    """Return what a run's folder is called after; 0 is an own condition."""
    return f"case{case:02d}" if case else "own"


def look_of(typed: Typed) -> dict[str, Value]:
    """Return the parameters of how markers look, for the rig's camera and for the tracker.

    Raises:
        ParameterError: They name no colours, or such as are too much alike.
    """
    names = options(MarkerLook)
    values = typed_values(MarkerLook, {k: v for k, v in typed.items() if k in names}, spelled)
    _ = build(MarkerLook, values, owner="winding run").hues
    return values


def check_camera(
    *,
    external: bool,
    camera: bool,
    composed: bool,
    frame_rate: int | None,
    pixels: Typed,
    others: Iterable[Typed],
) -> None:
    """Refuse an unknown frame rate, and options of a camera that there is not.

    Args:
        external: Whether the machine is an external one.
        camera: Whether it has one.
        composed: Whether frames come from a real camera's process.
        frame_rate: Of the simulated camera.
        pixels: What was typed of how a real camera's pixels are read.
        others: What else was typed of camera and tracker.
    """
    if frame_rate not in (None, 200, 1000):
        refuse(f"--frame-rate must be 200 or 1000, got {frame_rate}")
    if pixels and not (external or composed):
        refuse(f"{_listed(pixels)} for the pictures of a real camera, not the simulated one's")
    given_keys = [key for typed in (pixels, *others) for key in typed]
    if given_keys and not camera:
        refuse(f"{_listed(given_keys, 'need', 'needs')} a camera")


def _listed(keys: Iterable[str], many: str = "are", one: str = "is") -> str:
    words = [spelled(key) for key in keys]
    if len(words) == 1:
        return f"{words[0]} {one}"
    return f"{', '.join(words[:-1])} and {words[-1]} {many}"


def check_page_and_file(page: bool, port: int | None, parameters: Path | None) -> None:
    """Refuse a page's port without a page, and a parameter file that there is not."""
    if port is not None and not page:
        refuse("--dashboard-port is for a run with --dashboard")
    if parameters is not None and not parameters.is_file():
        refuse(f"--parameters: there is no file {parameters}")


def lay_of(
    wanted: str | None, *, published: bool, composed: bool, wish: Mapping[str, Value]
) -> str:
    """Return where the cable shall lie; refuse what was not published or is not shown.

    Args:
        wanted: What was typed.
        published: Whether the paper measured it.
        composed: Whether the camera runs in the tracker's process.
        wish: Of the wanted lay, where it is controlled.
    """
    if wanted not in (None, "driven") and wish.get("control") == "drive":
        refuse(f"--control drive moves the cable, and --lay {wanted} does not: use --lay driven")
    lay = wanted or ("driven" if wish else "paper" if published else "fem")
    if lay == "driven" and composed:
        refuse("--lay driven is shown by the rig's own camera alone: leave out --compose")
    if lay == "paper" and not published:
        refuse("--lay paper is what the paper measured of cases 1 to 12; use --lay fem")
    return lay


def recording_of(compression: str, split_mb: float) -> BagConfig:
    """Return how a bag is stored; refuse what no bag can be."""
    from winding_recorder.bags.mcap_file import BagConfig

    if not 0.0 <= split_mb < math.inf:
        refuse(f"--split-mb must be finite and not negative, got {split_mb:g}")
    try:
        return BagConfig(compression=compression, split_bytes=round(split_mb * MEGABYTE))
    except ValueError as error:
        refuse(error)


def composed_camera(
    wanted: str | None,
    machine: ExternalMachineConfig | None,
    *,
    attach: bool,
    secure: bool,
) -> str:
    """Return what opens a camera in the tracker's process; empty for one that publishes.

    Args:
        wanted: What was typed: camera for the simulated one, or a camera source.
        machine: The external machine; None for the simulated one.
        attach: Whether the nodes run elsewhere.
        secure: Whether they are held to their policies.
    """
    if wanted is None:
        return ""
    from winding_core.camera_source import CameraSource, CameraSourceError

    if attach:
        refuse("with --attach the tracker runs elsewhere: compose its camera there")
    if secure:
        refuse("--compose and --secure exclude each other: no policy lets the tracker show frames")
    if machine is None:
        if wanted != "camera":
            refuse("the simulated machine has a camera of its own: --compose camera")
        from winding_ros.graph import SIMULATED_CAMERA

        return SIMULATED_CAMERA
    if not machine.camera:
        refuse("--compose and --no-camera exclude each other")
    if wanted == "camera":
        refuse(
            "--compose camera is for the simulated machine; name what opens yours, "
            "MODULE:FUNCTION or FILE.py:FUNCTION"
        )
    # The tracker's process finds modules in the present folder, as `python -m` does.
    sys.path.append(str(Path.cwd()))
    try:
        CameraSource.parsed(wanted)
    except CameraSourceError as error:
        refuse(error)
    return wanted


def check_before_start(config: RunConfig) -> None:
    """Refuse what would end the run after its nodes have started."""
    from winding_supervisor.session.run_config import check_run

    try:
        check_run(config)
    except ValueError as error:
        refuse(error)
    _check_weights(config)
    check_output_folder(config.bag, "--bag", new=True)
    check_output_folder(config.directory, "--output", new=not config.numbered)


def _check_weights(config: RunConfig) -> None:
    from correction_node.models.weights import load_factor, weights_directory
    from winding_ros import topics

    name = config.parameters()[topics.CORRECTION].get("weights")
    if name:
        try:
            load_factor(weights_directory(str(name)))
        except (OSError, ValueError) as error:
            refuse(error)


@dataclass(frozen=True, kw_only=True)
class MachineOptions:
    """What is typed of an external machine beside its axes.

    Attributes:
        wound_length_mm: Undeformed cable after which the run ends [mm]; None for the drive's.
    """

    camera: bool = True  # Whether it has one
    start: str = "service"  # How it begins: service or motion
    turns: float | None = None  # After which the run ends; None for the drive's
    wound_length_mm: float | None = None
    standing_s: float = 60.0  # A machine that stands for longer has ended its run [s]
    lead: float = 0.0  # Way by which a controlled carriage goes ahead of the cable at first [m]


def machine_of(
    machine: str,
    axes: Typed,
    what: ResolvedCondition,
    options: MachineOptions,
    simulated: Mapping[str, object],
) -> ExternalMachineConfig | None:
    """Return the external machine that was asked for; None for the simulated one.

    Ends the command when the options contradict each other.

    Args:
        machine: simulated or external.
        axes: What was typed of its axes.
        what: Is wound.
        options: What was typed of it beside.
        simulated: What was typed that only the simulated machine takes, by option.
    """
    if machine not in (SIMULATED, EXTERNAL):
        refuse(f"--machine must be {SIMULATED} or {EXTERNAL}, got {machine}")
    if machine == SIMULATED:
        for name in (*axes, *_typed_beside(options)):
            refuse(f"{spelled(name)} needs --machine {EXTERNAL}")
        with refused(ParameterError):
            _check_numbers(simulated)
        return None
    for name, value in simulated.items():
        if value is not None:
            refuse(f"--{name} is for the simulated machine")
    _check(options)
    from winding_supervisor.machines.external_machine import ExternalMachineConfig

    return ExternalMachineConfig(
        axes=machine_axes(axes),
        drive=what.drive,
        end_angle=_end_angle(options, what),
        camera=options.camera,
        starts_itself=options.start == "motion",
        standing_limit=options.standing_s,
        lead=options.lead,
    )


def _check_numbers(simulated: Mapping[str, object]) -> None:
    """Hold the numbers that were typed, by option, against what the rig's parameters declare."""
    from winding_rig_node.ros.parameters import RigParameters

    declared = {spelled(item.name)[2:]: item for item in declarations(RigParameters)}
    for name, value in simulated.items():
        if isinstance(value, int | float) and name in declared:
            dataclasses.replace(declared[name], title=f"--{name}").convert(value)


def _typed_beside(options: MachineOptions) -> Iterator[str]:
    """Yield the options of an external machine that were typed, its axes aside."""
    usual = MachineOptions()
    if not options.camera:
        yield "no_camera"
    for name in ("start", "turns", "wound_length_mm", "standing_s"):
        if getattr(options, name) != getattr(usual, name):
            yield name


def machine_axes(typed: Typed) -> MachineAxes:
    """Return the axes that were typed; end the command when they contradict each other."""
    with refused(ParameterError, ValueError):
        return build(MachineAxes, typed_values(MachineAxes, typed, spelled), owner="the machine")


def _check(options: MachineOptions) -> None:
    if options.start not in ("service", "motion"):
        refuse(f"--start must be service or motion, got {options.start}")
    if options.turns is not None and options.wound_length_mm is not None:
        refuse("give --turns or --wound-length-mm, not both")
    for name, value in (
        ("turns", options.turns),
        ("wound-length-mm", options.wound_length_mm),
        ("standing-s", options.standing_s),
    ):
        if value is not None and not (math.isfinite(value) and value > 0.0):
            refuse(f"--{name} must be positive, got {value}")


def _end_angle(options: MachineOptions, what: ResolvedCondition) -> float:
    """Return the angle [rad] at which the run ends."""
    if options.turns is not None:
        return 2.0 * math.pi * options.turns
    if options.wound_length_mm is not None:
        laid = math.hypot(what.case.centreline_radius, what.drive.advance_per_radian)
        return MILLIMETRE * options.wound_length_mm * what.case.expected_stretch / laid
    return float(what.drive.positions(what.duration)[0])


def page_parameters(
    port: int | None, file: Path | None, namespace: str, camera: Mapping[str, object]
) -> dict[str, object]:
    """Return the page's parameters, from the user's file and the command line.

    Ends the command when the page cannot be served.

    Args:
        port: Of the command line, or None.
        file: The user's parameter file, or None.
        namespace: Of the graph.
        camera: Where it stands according to the command line.
    """
    from winding_ros.graph import PAGE, parameters_of
    from winding_ros.runtime.parameter_files import parameters_for

    known = {item.name for item in declarations(parameters_of(PAGE))}
    values: dict[str, object] = {}
    with refused(ParameterError, ValueError):
        if file is not None:
            of_tracker = parameters_for(file, f"/{namespace}/{_TRACKER}")
            values |= {name: of_tracker[name] for name in _CAMERA if name in of_tracker}
            own = parameters_for(file, f"/{namespace}/{_PAGE}")
            values |= {name: value for name, value in own.items() if name in known}
        values |= camera
        if port is not None:
            values["port"] = port
        page: Any = build(parameters_of(PAGE), values, owner=PAGE.name)
        page.check()
    _refuse_without_page()
    _refuse_taken(page.host, page.port)
    return values | {"host": page.host, "port": page.port}


def _refuse_without_page() -> None:
    from importlib.util import find_spec

    if find_spec("uvicorn") is None:
        refuse("the page needs its web server: pip install cable-winding-twin[dashboard]")


def _refuse_taken(host: str, port: int) -> None:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family) as probe:
        # As the web server does: a port that was served a moment ago may be served again.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            refuse(
                f"the page cannot be served on {host}, port {port}: {error.strerror}; "
                "choose another with --dashboard-port"
            )
