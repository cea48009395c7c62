"""The Python that runs this, the wheels that the graph imports, variables of ROS, addresses.

As a program it imports the modules that its arguments name: an import may end its process.
"""

import importlib
import json
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from importlib import metadata
from typing import Any

from winding_cli.doctor.finding import Finding, fail, ok, warn

DISTRIBUTION = "cable-winding-twin"
# A reserved domain (RFC 2606): the value stands in for one.
STAND_IN = ".example"
_CHECK = "addresses of the project"
RMW = "rmw_fastrtps_cpp"
_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
_UNWANTED = {
    "ROS_LOCALHOST_ONLY": f"it is deprecated and overrides {_RANGE}",
    "ROS_STATIC_PEERS": "nodes look for others on those machines too",
    "ROS_DISCOVERY_SERVER": "nodes find each other only through it",
}

PYTHONS = ((3, 11), (3, 12), (3, 13))
_PATIENCE = 180.0
# Extra that a graph runs without -> commands that need it.
NEEDED_BY = {
    "dashboard": "only `winding dashboard` needs it",
    "train": "only `winding train` and `winding study` need it",
}
# Module -> distribution that states its version, extra of the project that brings it.
WHEELS = {
    **{
        name: (name, "ros")
        for name in (
            "rclpy",
            "diagnostic_msgs",
            "geometry_msgs",
            "lifecycle_msgs",
            "rosgraph_msgs",
            "sensor_msgs",
            "std_msgs",
            "std_srvs",
            "visualization_msgs",
        )
    },
    **{name: (name, "") for name in ("numpy", "scipy", "numba")},
    "cv2": ("opencv-python-headless", ""),
    **{name: (name, "") for name in ("rosbags", "mcap")},
    "uvicorn": ("uvicorn", "dashboard"),
    "torch": ("torch", "train"),
    "sklearn": ("scikit-learn", "train"),
}


@dataclass(frozen=True, kw_only=True)
class Imported:
    """How an import ended."""

    error: str = ""  # Why it failed; empty when it did not
    remark: str = ""  # What speaks against this build of it


def judge_python(version: tuple[int, ...]) -> Finding:
    """Return whether the wheels of ROS exist for this Python."""
    text = ".".join(map(str, version[:3]))
    if tuple(version[:2]) in PYTHONS:
        return ok("python", text)
    wanted = " or ".join(f"{major}.{minor}" for major, minor in PYTHONS)
    return fail("python", text, f"make a virtual environment of Python {wanted}")


def judge_wheels(imported: Mapping[str, Imported]) -> list[Finding]:
    """Return one finding for each wheel.

    Args:
        imported: How each import ended, by module; what is missing ended the importing process.
    """
    crashed = Imported(error="the import ended the whole process")
    return [_judge(module, imported.get(module, crashed)) for module in WHEELS]


def _judge(module: str, result: Imported) -> Finding:
    distribution, extra = WHEELS[module]
    check = f"wheel {module}"
    install = f"pip install 'cable-winding-twin{f'[{extra}]' if extra else ''}'"
    if result.error and extra in NEEDED_BY:
        return ok(check, f"not there; {NEEDED_BY[extra]} ({install})")
    if result.error:
        source = ", or source /opt/ros/jazzy/setup.bash" if extra == "ros" else ""
        return fail(check, result.error, install + source)
    version = version_of(distribution) or "version unknown"
    if result.remark:
        return warn(check, f"{version}: {result.remark}", install)
    return ok(check, version)


def version_of(distribution: str) -> str:
    """Return the version of an installed distribution; empty where it is not installed."""
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return ""


def import_all(modules: Iterable[str], environment: Mapping[str, str]) -> dict[str, Imported]:
    """Return how the imports end, by module, in a process of their own."""
    results: dict[str, Imported] = {}
    waiting = list(modules)
    while waiting:
        ended = _run(waiting, environment)
        results |= ended
        # The next module took the process with it; the others go on without it.
        waiting = waiting[len(ended) + 1 :]
    return results


def _run(modules: Iterable[str], environment: Mapping[str, str]) -> dict[str, Imported]:
    try:
        output = subprocess.run(
            [sys.executable, "-m", __name__, *modules],
            env=dict(environment),
            capture_output=True,
            timeout=_PATIENCE,
            check=False,
        ).stdout
    except subprocess.TimeoutExpired as late:
        output = late.stdout or b""
    records = (json.loads(line) for line in output.splitlines() if line.startswith(b"{"))
    return {record.pop("module"): Imported(**record) for record in records}


def _import(name: str) -> Imported:
    try:
        module = importlib.import_module(name)
        _load_type_support(name)
    except Exception as error:  # noqa: BLE001 - a broken wheel raises what it likes
        return Imported(error=" ".join(f"{type(error).__name__}: {error}".split()))
    if name == "torch" and module.version.cuda is not None:
        return Imported(
            remark="a build for GPUs; the graph uses the processor alone and loads slower with it"
        )
    if name == "cv2" and not version_of(WHEELS[name][0]) and version_of("opencv-python"):
        return Imported(
            remark="opencv-python brings a desktop's libraries; the headless one is tested"
        )
    return Imported()


def _load_type_support(module: str) -> None:
    """Load the compiled half of a package of messages, which Python imports only on use."""
    if not module.endswith(("_msgs", "_srvs")):
        return
    kind = "srv" if module.endswith("_srvs") else "msg"
    messages = importlib.import_module(f"{module}.{kind}")
    first: Any = next(value for value in vars(messages).values() if isinstance(value, type))
    first.__class__.__import_type_support__()
    if first.__class__._TYPE_SUPPORT is None:
        raise ImportError(f"{module} has no type support for this middleware")


def judge_addresses(facts: metadata.PackageMetadata | None) -> Finding:
    """Return whether the project's maintainer and its sites have been filled in.

    Args:
        facts: Metadata of the installed distribution; None for a workspace, which colcon
            installs package by package.
    """
    if facts is None:
        return ok(_CHECK, "a workspace; each package.xml names its maintainer")
    sites = [url.partition(", ") for url in facts.get_all("Project-URL") or ()]
    (maintainer,) = facts.get_all("Maintainer-email") or ("",)
    named = {"maintainer": maintainer} | {label: address for label, _, address in sites}
    missing = [label for label, address in named.items() if not address or STAND_IN in address]
    if not missing:
        return ok(_CHECK, ", ".join(named))
    return warn(
        _CHECK,
        f"to be filled in: {', '.join(missing)}",
        "publisher: maintainers and [project.urls] in pyproject.toml; the graph needs none",
    )


def installed() -> metadata.PackageMetadata | None:
    """Return the metadata of the installed distribution; None where there is none."""
    try:
        return metadata.metadata(DISTRIBUTION)
    except metadata.PackageNotFoundError:
        return None


def judge_variables(
    environment: Mapping[str, str], is_file: Callable[[str], bool]
) -> list[Finding]:
    """Return one finding for each variable that matters, as it was before the command set any."""
    return [
        _middleware(environment.get("RMW_IMPLEMENTATION")),
        _discovery_range(environment.get(_RANGE)),
        *(
            warn(name, f"{environment[name]!r}: {effect}", f"unset {name} unless you need it")
            if name in environment
            else ok(name, "not set")
            for name, effect in _UNWANTED.items()
        ),
        _profiles(environment.get(_PROFILES), is_file),
    ]


def _middleware(value: str | None) -> Finding:
    check = "RMW_IMPLEMENTATION"
    if not value:
        return ok(check, f"not set; {RMW} is the wheels' only one")
    if value == RMW:
        return ok(check, value)
    return fail(check, f"{value}; the graph is made for {RMW}", f"unset {check}")


def _discovery_range(value: str | None) -> Finding:
    if not value:
        return ok(_RANGE, "not set; the command keeps to this host")
    if value == "LOCALHOST":
        return ok(_RANGE, value)
    if value in ("SUBNET", "SYSTEM_DEFAULT"):
        return warn(
            _RANGE,
            f"{value}: other machines see the graph and may publish into it",
            f"unset {_RANGE} unless they have to",
        )
    reason = "nodes do not find each other" if value == "OFF" else "no such range"
    return fail(_RANGE, f"{value}: {reason}", f"unset {_RANGE}")


def _profiles(value: str | None, is_file: Callable[[str], bool]) -> Finding:
    if value is None:
        return ok(_PROFILES, "not set; the command sets the graph's own")
    if not value or not is_file(value):
        effect = "is no file; Fast DDS complains and keeps to its defaults"
        return warn(_PROFILES, f"{value!r} {effect}", f"unset {_PROFILES}")
    return warn(
        _PROFILES,
        f"{value} takes the place of the graph's own, with its transports and leases",
        f"unset {_PROFILES} unless you need it",
    )


if __name__ == "__main__":
    for wanted in sys.argv[1:]:
        print(json.dumps({"module": wanted, **vars(_import(wanted))}), flush=True)
