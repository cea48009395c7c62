"""Options of a run that several nodes and commands share, each record declared once."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Self

from winding_core.error_verdict import ErrorLimit
from winding_core.lay.errors import LayTolerance
from winding_core.machine.axes import MachineAxes
from winding_core.markers import MarkerParameters
from winding_core.parameters import parameter
from winding_core.raw_image import ENCODINGS
from winding_core.units import LENGTH, PATH, PLAIN, ROW_TIME, SHORT_TIME, SIZE, SMALL_ANGLE, TIME

SIMULATED, EXTERNAL = "simulated", "external"
# How an external machine begins.
BY_SERVICE, BY_MOTION = "service", "motion"
LAY_MEANING = (
    "where the simulated cable lies: paper, as published; fem, a cable with hidden properties; "
    "driven, what the machine's own motion and pull lay, whatever is commanded"
)
# Elements that a cable is made of.
ELEMENTS = ("rod", "solid")
# How a driver's frames come.
TRANSPORTS = ("raw", "compressed")
_NAMESPACE = re.compile(r"[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)*")


@dataclass(frozen=True, kw_only=True)
class SolverOptions:
    """How the solver winds: element, mesh, mass scaling and rolling."""

    element: str = parameter(
        "rod", "element that the cable is made of; solid is the paper's C3D8R", PLAIN,
        choices=ELEMENTS,
    )  # fmt: skip
    segment_length: float = parameter(
        0.0,
        "undeformed length of an element",
        LENGTH,
        0.0001,
        0.05,
        otherwise="what suits cable and cylinder, 5 mm at most",
        option="segment",
    )
    mass_scaling: float = parameter(
        0.0,
        "factor on the cable's density",
        PLAIN,
        1.0,
        1.0e4,
        otherwise="1 with the rod and 400 with the solid",
    )
    rolling: bool = parameter(False, "whether the cable may roll on the cylinder", PLAIN)


@dataclass(frozen=True, kw_only=True)
class SimulatedMachine:
    """What only the simulated machine takes."""

    lay: str = parameter("", LAY_MEANING, PLAIN)
    speed: float = parameter(
        1.0, "simulated seconds per second; 0 = as fast as the slowest consumer follows", PLAIN,
        0.0, 1000.0,
    )  # fmt: skip
    seed: int = parameter(1, "seed of sensor noise and of the hidden cable", PLAIN, 0)
    truth_file: str = parameter(
        "",
        "file of where the cable truly lies and of what was hidden, written at the end of the "
        "run and on deactivation (JSON); empty for none",
        PATH,
        option="truth",
    )
    machine_file: str = parameter(
        "",
        "file of the arm that carries the guide of the simulated machine; empty for a carriage",
        PATH,
    )


@dataclass(frozen=True, kw_only=True)
class SimulatedCamera:
    """What only the simulated camera takes."""

    frame_rate: int = parameter(200, "frames per simulated second: 200 or 1000", PLAIN, 200, 1000)
    camera_noise: float = parameter(
        1.5, "read noise of the camera, one standard deviation [grey levels]", PLAIN, 0.0, 50.0
    )


@dataclass(frozen=True, kw_only=True)
class RunMachine(MachineAxes, SimulatedMachine):
    """Which machine winds."""

    machine: str = parameter(
        SIMULATED, "who winds; external is a driver that runs already", PLAIN,
        choices=(SIMULATED, EXTERNAL),
    )  # fmt: skip
    start: str = parameter(
        BY_SERVICE,
        "how an external machine begins: service calls rig/start, motion waits for it",
        PLAIN,
        choices=(BY_SERVICE, BY_MOTION),
    )
    turns: float = parameter(
        0.0, "turns after which an external run ends", PLAIN, 1.0e-6, otherwise="the drive's"
    )
    wound_length: float = parameter(
        0.0, "undeformed cable after which an external run ends, about", LENGTH, 1.0e-6,
        otherwise="the drive's turns",
    )  # fmt: skip
    standing: float = parameter(
        60.0, "standstill after which an external machine has ended its run", TIME, 1.0e-3
    )


@dataclass(frozen=True, kw_only=True)
class CameraPlacement:
    """Extrinsics of the camera: nominally it faces -x, image right +z, image down +y."""

    camera_position: list[float] = parameter(
        [0.4175, 0.0, 0.05], "camera position in winder_axis", LENGTH, -10.0, 10.0
    )
    camera_tilt: list[float] = parameter(
        [0.0, 0.0, 0.0],
        "rotation of the camera from facing -x, image right +z, image down +y",
        SMALL_ANGLE,
        -0.5,
        0.5,
    )


@dataclass(frozen=True, kw_only=True)
class CameraClockParameters:
    """Whether the measured offset of the camera's clock is corrected, and how large it may be."""

    camera_clock_correction: bool = parameter(
        False, "whether the measured offset of the camera's clock is applied to later frames", PLAIN
    )
    camera_clock_limit: float = parameter(
        0.25, "largest offset of the camera's clock with which frames are used", SHORT_TIME,
        0.001, 2.0,
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class CameraPixels:
    """What the stream does not state about its pixels, or states wrongly."""

    encoding: str = parameter(
        "", "how the pixels are encoded, whatever the pictures say", PLAIN,
        choices=("", *ENCODINGS),
    )  # fmt: skip
    significant_bits: int = parameter(
        0, "bits that count in words of 16 bits, from the lowest", PLAIN, 8, 16, otherwise="16"
    )
    row_time: float = parameter(
        0.0,
        "time from a row of the picture to the next of a rolling shutter, negative where the "
        "lowest row is read first; the stamp is that of the row read first",
        ROW_TIME,
        -0.001,
        0.001,
    )


@dataclass(frozen=True, kw_only=True)
class RunCamera(CameraPlacement, CameraPixels, CameraClockParameters, SimulatedCamera):
    """Which camera looks, from where, and what it delivers."""

    camera: bool = parameter(True, "whether an external machine has a camera", PLAIN)
    image_transport: str = parameter(
        "raw",
        "how a driver's frames come: raw on camera/image_raw, compressed on its compressed topic",
        PLAIN,
        choices=TRANSPORTS,
    )
    compose: str = parameter(
        "",
        "track frames in the camera's process: camera for the simulated one, or what opens a real "
        "one, MODULE:FUNCTION or FILE.py:FUNCTION",
        PLAIN,
    )


@dataclass(frozen=True, kw_only=True)
class LayParameters:
    """What is measured beside the markers."""

    measure_lay: bool = parameter(True, "whether every turn on the cylinder is measured", PLAIN)


@dataclass(frozen=True, kw_only=True)
class RunTracking(MarkerParameters, LayParameters):
    """What is looked for, and measured."""


@dataclass(frozen=True, kw_only=True)
class LayWish:
    """Where the cable is wanted, and whether the controller drives the machine for it."""

    control: str = parameter(
        "watch",
        "how the lay controller begins; watch reports its commands only",
        PLAIN,
        choices=("off", "watch", "drive"),
    )
    program: str = parameter(
        "", "lay program: a file of CSV, YAML or G-code; empty for an even helix", PATH
    )
    pitch: float = parameter(
        0.0,
        "axial advance per turn of the even helix",
        LENGTH,
        -1.0,
        1.0,
        otherwise="the drive programme's",
    )
    markers_every_turn: bool = parameter(
        False, "whether marker n is wanted after n turns; needs a brake", PLAIN
    )
    brake: bool = parameter(False, "whether the machine has a brake that takes commands", PLAIN)


COMPONENT = "limits"  # Component of the page's status that carries the limits


@dataclass(frozen=True, kw_only=True)
class OperatorLimits(ErrorLimit, LayTolerance):
    """How far off a corrected length and a turn may be."""

    @classmethod
    def from_values(cls, values: Mapping[str, str]) -> Self | None:
        """Return the limits that diagnostics carry; None where they carry none."""
        try:
            return cls(**{item.name: float(values[item.name]) for item in fields(cls)})
        except (KeyError, ValueError):
            return None

    def values(self) -> dict[str, str]:
        """Return the limits as values of a status, to the last digit."""
        return {name: repr(value) for name, value in vars(self).items()}


@dataclass(frozen=True, kw_only=True)
class RunCorrection:
    """How predicted lengths are corrected."""

    weights: str = parameter("", "trained weight: shipped name or folder", PLAIN)


@dataclass(frozen=True, kw_only=True)
class RunRecording:
    """What a run leaves, and where."""

    output: str = parameter(
        "", "new folder of logs, report and numbers; else runs/<time>-case<N>", PATH
    )
    report: str = parameter("", "folder of the report; else report in that folder", PATH)
    json: str = parameter("", "file of the run's numbers; else run.json in that folder", PATH)
    bag: str = parameter("", "record every topic into this new rosbag2 folder", PATH)
    compression: str = parameter(
        "none", "compression of MCAP chunks", PLAIN, choices=("none", "zstd")
    )
    split: float = parameter(
        2.0e9, "size after which a further file of the bag begins; 0 = never", SIZE, 0.0
    )
    trace: str = parameter(
        "", "file of where each corrected length's time went, for Perfetto (Trace Event JSON)", PATH
    )


@dataclass(frozen=True, kw_only=True)
class RunPage:
    """Whether an operator conducts the run."""

    dashboard: bool = parameter(
        False, "whether the operator's page is served, and the run waits for its Start", PLAIN
    )
    dashboard_port: int = parameter(8080, "TCP port of that page", PLAIN, 1, 65535)


_LONGEST_LABEL = 200  # A label fits a column of a table [characters]


@dataclass(frozen=True, kw_only=True)
class RunLabels:
    """Which cable is wound, where, by whom, and what is noted of it."""

    cable: str = parameter(
        "", "cable of the library, by its name, or a cable file; see `winding cable list`", PLAIN
    )
    library: str = parameter("", "folder of own cables; otherwise the user's", PATH)
    machine_name: str = parameter("", "name of the machine; otherwise simulated or external", PLAIN)
    batch: str = parameter("", "batch that the cable is of", PLAIN)
    operator: str = parameter("", "who winds", PLAIN)
    remark: str = parameter("", "what else is to be known of the run", PLAIN)

    def __post_init__(self) -> None:
        for name, text in vars(self).items():
            if len(text) > _LONGEST_LABEL or not text.isprintable():
                raise ValueError(
                    f"{name} must be printable and at most {_LONGEST_LABEL} characters long, "
                    f"got {text[:40]!r}"
                )

    def named(self, cable: str, machine: str) -> dict[str, str]:
        """Return what is known of a run, by what it is.

        Args:
            cable: Name of the cable; empty where none is named.
            machine: What winds where the machine has no name.
        """
        found = {
            "cable": cable,
            "machine": self.machine_name or machine,
            "batch": self.batch,
            "operator": self.operator,
            "remark": self.remark,
        }
        return {name: text for name, text in found.items() if text}


@dataclass(frozen=True, kw_only=True)
class RunGraph:
    """Where the nodes run, and with what."""

    parameters: str = parameter("", "ROS parameter file for the nodes", PATH)
    domain: int = parameter(0, "DDS domain, else that of ROS_DOMAIN_ID", PLAIN, 0, 232)
    namespace: str = parameter("winding", "namespace of the graph", PLAIN)
    attach: bool = parameter(
        False, "whether the nodes run already, such as in containers of their own", PLAIN
    )
    secure: bool = parameter(
        False, "whether the run is refused unless DDS security is enforced", PLAIN
    )

    def __post_init__(self) -> None:
        if not _NAMESPACE.fullmatch(self.namespace):
            raise ValueError(
                f"namespace must be made of letters, digits, _ and /, got {self.namespace!r}"
            )
