"""A process that imports what it is told to, one line of JSON each: an import may end it."""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
from collections.abc import Iterable, Mapping
from importlib import metadata
from typing import Any

from winding_cli.doctor.wheels import Imported, Wheel

_PATIENCE = 180.0


def import_all(wheels: Iterable[Wheel], environment: Mapping[str, str]) -> dict[str, Imported]:
    """Return how the imports end, by module, in a process of their own."""
    results: dict[str, Imported] = {}
    waiting = list(wheels)
    while waiting:
        said = _run(waiting, environment)
        results |= said
        # What comes next took the process with it; the others go on without it.
        waiting = waiting[len(said) + 1 :]
    return results


def _run(wheels: Iterable[Wheel], environment: Mapping[str, str]) -> dict[str, Imported]:
    try:
        done = subprocess.run(
            [sys.executable, "-m", __name__, *(f"{w.module}={w.distribution}" for w in wheels)],
            env=dict(environment),
            capture_output=True,
            text=True,
            timeout=_PATIENCE,
            check=False,
        )
        output = done.stdout
    except subprocess.TimeoutExpired as late:
        output = late.stdout.decode() if isinstance(late.stdout, bytes) else late.stdout or ""
    results = {}
    for line in output.splitlines():
        if line.startswith("{"):
            record = json.loads(line)
            module = str(record.pop("module"))
            results[module] = Imported(**record)
    return results


def _import(name: str, distribution: str) -> Imported:
    try:
        module = importlib.import_module(name)
        _load_type_support(name)
        remark = _remark(name, module)
    except Exception as error:  # noqa: BLE001 - a broken wheel raises what it likes
        return Imported(error=" ".join(f"{type(error).__name__}: {error}".split()))
    return Imported(version=_version(distribution), remark=remark)


def _version(distribution: str) -> str:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return ""


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


def _remark(name: str, module: Any) -> str:
    if name == "torch" and module.version.cuda is not None:
        return "a build for GPUs; the graph uses the processor alone and loads slower with it"
    if name == "cv2" and not _version("opencv-python-headless") and _version("opencv-python"):
        return "opencv-python brings a desktop's libraries; the headless one is tested"
    return ""


def _main(wanted: list[str]) -> None:
    for pair in wanted:
        name, _, distribution = pair.partition("=")
        print(json.dumps({"module": name, **vars(_import(name, distribution))}), flush=True)


if __name__ == "__main__":
    _main(sys.argv[1:])
