"""The Python that runs this and the wheels that the graph imports.

As a program it imports the modules that its arguments name: an import may end its process.
"""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib import metadata
from typing import Any

from winding_cli.doctor.finding import Finding, fail, ok, warn

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
    """How an import ended.

    Attributes:
        error: Why it failed; empty when it did not.
        remark: What speaks against this build of it.
    """

    error: str = ""
    remark: str = ""


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
    version = _version(distribution) or "version unknown"
    if result.remark:
        return warn(check, f"{version}: {result.remark}", install)
    return ok(check, version)


def _version(distribution: str) -> str:
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
    if name == "cv2" and not _version(WHEELS[name][0]) and _version("opencv-python"):
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


if __name__ == "__main__":
    for wanted in sys.argv[1:]:
        print(json.dumps({"module": wanted, **vars(_import(wanted))}), flush=True)
