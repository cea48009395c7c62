"""The mapping file: where a machine's values and commands are on its OPC UA server."""

import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from winding_core.machine.readings import CABLE_TENSION, Quantity
from winding_core.parameters import ParameterError, build, parameter, refuse_unknown
from winding_core.yaml_text import YamlTextError, load_yaml

# Units of a value by the SI unit that it becomes, each with its factor; a quantity of a unit that
# is missing here is read in that unit alone.
UNITS: Mapping[str, Mapping[str, float]] = {
    "rad": {"rad": 1.0, "deg": math.pi / 180.0, "turn": 2.0 * math.pi},
    "rad/s": {"rad/s": 1.0, "deg/s": math.pi / 180.0, "rpm": math.pi / 30.0},
    "m": {"m": 1.0, "mm": 1e-3, "um": 1e-6},
    "m/s": {"m/s": 1.0, "mm/s": 1e-3, "m/min": 1.0 / 60.0},
    "N": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
}
ANGLE, CARRIAGE = "angle", "carriage"
ANGULAR_SPEED, FEED_SPEED = "angular_speed", "feed_speed"
START, STOP, QUICK_STOP = "start", "stop", "quick_stop"
RESET, EMERGENCY_STOP = "reset", "emergency_stop"
# SI units of the variables that make a joint state; every other variable is a `Quantity`.
AXES: Mapping[str, str] = {ANGLE: "rad", CARRIAGE: "m", ANGULAR_SPEED: "rad/s", FEED_SPEED: "m/s"}
_NEEDED = (ANGLE, CARRIAGE, CABLE_TENSION.name)
_FACTORS = {unit: factor for units in UNITS.values() for unit, factor in units.items()}
COMMANDS = (START, STOP, QUICK_STOP, RESET, EMERGENCY_STOP)
_NODE_ID = re.compile(r"(ns=\d+;|nsu=[^;]+;)?(i=\d+|[sgb]=.+)", re.DOTALL)


class MappingError(ValueError):
    """A mapping file cannot be used."""


@dataclass(frozen=True, kw_only=True)
class Server:
    """How the PLC's OPC UA server is reached."""

    endpoint: str = parameter("", "address, such as opc.tcp://192.168.0.10:4840")
    security_policy: str = parameter(
        "None",
        "security policy of the channel",
        choices=("None", "Basic256Sha256", "Aes128Sha256RsaOaep", "Aes256Sha256RsaPss"),
    )
    security_mode: str = parameter(
        "SignAndEncrypt",
        "what a policy other than None protects",
        choices=("Sign", "SignAndEncrypt"),
    )
    certificate: str = parameter("", "file of the driver's certificate, DER or PEM")
    private_key: str = parameter("", "file of the driver's private key, DER or PEM")
    server_certificate: str = parameter("", "file of the only server certificate that is trusted")
    user: str = parameter("", "user name; empty for an anonymous session")
    password_variable: str = parameter("", "environment variable that holds the password")
    password_file: str = parameter("", "file whose first line is the password")
    user_certificate: str = parameter("", "file of a user's certificate, in place of a user name")
    user_private_key: str = parameter("", "file of that user's private key, DER or PEM")
    publishing_interval_s: float = parameter(0.02, "time between notifications", None, 0.001, 10.0)
    sampling_interval_s: float = parameter(
        0.0, "time between samples of a variable; 0 for the server's fastest", None, 0.0, 10.0
    )
    queue_size: int = parameter(1000, "values of a variable that the server queues", None, 1, 1e6)
    hold_s: float = parameter(
        60.0, "how long the server is asked to keep session and queue", None, 5.0, 3600.0
    )
    join_wait_s: float = parameter(
        0.1, "how long a value waits for the others of its time", None, 0.0, 10.0
    )
    call_timeout_s: float = parameter(
        2.0, "time after which an unanswered request is given up", None, 0.1, 60.0
    )
    link_timeout_s: float = parameter(
        2.0, "silence after which the link counts as lost", None, 0.2, 60.0
    )
    reconnect_wait_s: float = parameter(
        0.5, "wait after the first failed attempt, doubled with each", None, 0.05, 60.0
    )
    reconnect_wait_max_s: float = parameter(2.0, "longest such wait", None, 0.05, 600.0)
    stop_after_link_loss_s: float = parameter(
        0.0, "a link lost for longer has the machine stopped on return; 0: never", None, 0.0, 3600.0
    )


@dataclass(frozen=True, kw_only=True)
class Variable:
    """Node of a number of the machine, and its conversion to SI."""

    node: str = parameter("", "node id")
    unit: str = parameter("", "unit of the value")
    scale: float = parameter(1.0, "factor on the value, negative for a reversed axis")
    wraps_at: float = parameter(
        0.0, "value at which an angle starts again from 0; 0 for one that does not", None, 0.0
    )

    @property
    def factor(self) -> float:
        """Factor from the server's value to SI."""
        return self.scale * _FACTORS.get(self.unit, 1.0)


@dataclass(frozen=True, kw_only=True)
class State:
    """Where the machine's own state is."""

    node: str  # Node id of a number or text
    names: Mapping[int, str]  # What a number means
    faults: tuple[int | str, ...]  # Numbers and texts that are errors


@dataclass(frozen=True, kw_only=True)
class Command:
    """A method to call, or a variable to write."""

    object: str = ""  # Node id of the method's object; empty where a variable is written
    method: str = ""  # Node id of the method
    node: str = ""  # Node id of the variable; empty where a method is called
    value: bool | int = True  # What is written


@dataclass(frozen=True, kw_only=True)
class Heartbeat:
    """Signs of life in both directions."""

    read: str = parameter("", "node id of a counter that the PLC changes")
    write: str = parameter("", "node id of a counter that the driver changes")
    period_s: float = parameter(0.5, "time between the driver's signs", None, 0.02, 60.0)
    timeout_s: float = parameter(
        2.0, "time without a change after which the PLC's program stands", None, 0.1, 600.0
    )


@dataclass(frozen=True, kw_only=True)
class MachineMapping:
    """A mapping file."""

    server: Server  # How the PLC is reached
    # By the names of AXES and of quantities; speeds and quantities other than the tension may be
    # missing.
    variables: Mapping[str, Variable]
    commands: Mapping[str, Command]  # By the names of COMMANDS, all of them
    state: State | None  # The machine's own state; None where it reports none
    heartbeat: Heartbeat  # Node ids are empty where there is none

    @property
    def axes(self) -> tuple[str, ...]:
        """Variables that a joint state is made of, positions first."""
        return tuple(name for name in self.variables if name in AXES)

    @property
    def measured(self) -> tuple[str, ...]:
        """Variables that are a quantity each."""
        return tuple(name for name in self.variables if name not in AXES)


def read_mapping(path: Path, quantities: Collection[Quantity] = (CABLE_TENSION,)) -> MachineMapping:
    """Return a mapping file's content.

    Args:
        path: The file; file names in it are relative to its folder.
        quantities: That the graph has a topic for.

    Raises:
        MappingError: One sentence on the first thing that cannot be used.
    """
    try:
        return parse_mapping(path.read_text(encoding="utf-8"), path.parent, quantities)
    except (OSError, UnicodeError) as error:
        raise MappingError(f"{path} cannot be read: {error}") from None
    except MappingError as error:
        raise MappingError(f"{path}: {error}") from None


def parse_mapping(
    text: str, folder: Path, quantities: Collection[Quantity] = (CABLE_TENSION,)
) -> MachineMapping:
    """Return the mapping of a YAML text.

    Args:
        text: The document.
        folder: That its file names are relative to.
        quantities: That the graph has a topic for.

    Raises:
        MappingError: One sentence on the first thing that cannot be used.
    """
    try:
        top = _section(load_yaml(text), "the file")
        refuse_unknown(
            top, ("server", "variables", "commands", "state", "heartbeat"), owner="the file"
        )
        known = {**AXES, **{item.name: item.unit for item in quantities}}
        variables = _named(top, "variables", tuple(known), _NEEDED)
        # A PLC without a quick stop is stopped as fast as it can.
        commands = _named(top, "commands", COMMANDS, (START, STOP, RESET, EMERGENCY_STOP))
        commands.setdefault(QUICK_STOP, commands[STOP])
        return MachineMapping(
            server=_server(_section(top.get("server"), "server"), folder),
            variables={
                name: _variable(name, unit, variables[name])
                for name, unit in known.items()
                if name in variables
            },
            commands={name: _command(name, commands[name]) for name in COMMANDS},
            state=_state(_section(top["state"], "state")) if "state" in top else None,
            heartbeat=_heartbeat(_section(top.get("heartbeat", {}), "heartbeat")),
        )
    except (YamlTextError, ParameterError) as error:
        raise MappingError(str(error)) from None


def _section(value: Any, title: str) -> dict[str, Any]:
    if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
        got = "nothing" if value is None else repr(value)[:80]
        raise MappingError(f"{title} must be a mapping of names, got {got}")
    return value


def _named(
    top: dict[str, Any], title: str, known: tuple[str, ...], needed: tuple[str, ...]
) -> dict[str, Any]:
    section = dict(_section(top.get(title), title))
    refuse_unknown(section, known, owner=title)
    for name in needed:
        if name not in section:
            raise MappingError(f"{title} needs {name}")
    return section


def _check_node_id(title: str, text: object) -> None:
    if not isinstance(text, str) or not _NODE_ID.fullmatch(text):
        raise MappingError(f"{title} must be a node id such as ns=2;s=Machine.Angle, got {text!r}")


def _server(values: dict[str, Any], folder: Path) -> Server:
    server = build(Server, values, owner="server")
    if not re.fullmatch(r"opc\.tcp://[^/@\s:]+(:\d+)?(/\S*)?", server.endpoint):
        raise MappingError(
            "endpoint must be an address such as opc.tcp://192.168.0.10:4840, without a user name, "
            f"got {server.endpoint!r}"
        )
    secured = server.security_policy != "None"
    if secured != bool(server.certificate) or secured != bool(server.private_key):
        raise MappingError(
            "a security policy needs certificate and private_key, and policy None neither, got "
            f"policy {server.security_policy}, certificate {server.certificate!r}, "
            f"private_key {server.private_key!r}"
        )
    sources = bool(server.password_variable) + bool(server.password_file)
    if sources != bool(server.user):
        raise MappingError(
            "a user needs one of password_variable and password_file, and an anonymous session "
            f"neither, got user {server.user!r} with {sources} of them"
        )
    if bool(server.user_certificate) != bool(server.user_private_key):
        raise MappingError(
            "a user's certificate needs its key and the other way round, got user_certificate "
            f"{server.user_certificate!r}, user_private_key {server.user_private_key!r}"
        )
    if server.user and server.user_certificate:
        raise MappingError(
            "a session has one user, by name or by certificate, got user "
            f"{server.user!r} and user_certificate {server.user_certificate!r}"
        )
    files = (
        *("certificate", "private_key", "server_certificate", "password_file"),
        *("user_certificate", "user_private_key"),
    )
    found = {name: str(folder / path) for name in files if (path := getattr(server, name))}
    return replace(server, **found)  # type: ignore[arg-type]


def _variable(name: str, si_unit: str, values: Any) -> Variable:
    title = f"variable {name}"
    variable = build(Variable, _section(values, title), owner=title)
    _check_node_id(f"node of {title}", variable.node)
    units = tuple(UNITS.get(si_unit, (si_unit,)))
    if variable.unit not in units:
        raise MappingError(
            f"unit of {title} must be one of {', '.join(units)}, got {variable.unit!r}"
        )
    if variable.scale == 0.0:
        raise MappingError(f"scale of {title} must not be 0")
    if variable.wraps_at and name != ANGLE:
        raise MappingError(f"only the angle can wrap, got wraps_at of {title}")
    return variable


def _command(name: str, values: Any) -> Command:
    title = f"command {name}"
    section = _section(values, title)
    if set(section) not in ({"object", "method"}, {"node", "value"}):
        raise MappingError(
            f"{title} needs object and method, or node and value, got {', '.join(section)}"
        )
    for key in section.keys() - {"value"}:
        _check_node_id(f"{key} of {title}", section[key])
    if not isinstance(section.get("value", True), int):
        raise MappingError(
            f"value of {title} must be true, false or a whole number, got {section['value']!r}"
        )
    return Command(**section)


def _state(section: dict[str, Any]) -> State:
    refuse_unknown(section, ("node", "names", "faults"), owner="state")
    _check_node_id("node of state", section.get("node"))
    names, faults = section.get("names", {}), section.get("faults", [])
    if not isinstance(names, dict) or not all(
        isinstance(key, int) and isinstance(value, str) for key, value in names.items()
    ):
        raise MappingError(f"names of state must give a text for each number, got {names!r}")
    if not isinstance(faults, list) or not all(isinstance(item, int | str) for item in faults):
        raise MappingError(f"faults of state must be a list of numbers or texts, got {faults!r}")
    return State(node=section["node"], names=names, faults=tuple(faults))


def _heartbeat(values: dict[str, Any]) -> Heartbeat:
    heartbeat = build(Heartbeat, values, owner="heartbeat")
    for key in ("read", "write"):
        if getattr(heartbeat, key):
            _check_node_id(f"{key} of heartbeat", getattr(heartbeat, key))
    return heartbeat


def read_password(server: Server, environment: Mapping[str, str]) -> str:
    """Return the user's password; empty where there is no user.

    Raises:
        MappingError: It is nowhere to be found.
    """
    if not server.user:
        return ""
    if server.password_variable:
        if server.password_variable not in environment:
            raise MappingError(
                f"the password of user {server.user} is to be in the environment variable "
                f"{server.password_variable}, which is not set"
            )
        return environment[server.password_variable]
    try:
        lines = Path(server.password_file).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeError) as error:
        raise MappingError(f"the password file cannot be read: {error}") from None
    return lines[0] if lines else ""
