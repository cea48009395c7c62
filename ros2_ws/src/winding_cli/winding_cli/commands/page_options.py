"""The operator's page of a run: where it is served, and what the operator wound in the end."""

from __future__ import annotations

import socket
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from winding_cli.commands.refusal import refuse, refused

if TYPE_CHECKING:
    from winding_core.condition import Condition
    from winding_supervisor.session.run_config import RunResult

_TRACKER, _PAGE = "marker_tracker", "dashboard"
# The page draws frames where the tracker's camera stands.
_CAMERA = ("camera_position", "camera_tilt")


def page_parameters(
    port: int | None, file: Path | None, namespace: str, camera: Mapping[str, object]
) -> dict[str, object]:
    """Return the page's parameters, from the user's file and the command line.

    Ends the command when the page cannot be served.

    Args:
        port: Of the command line, or None.
        file: The user's parameter file, or None.
        namespace: Of the graph.
        camera: Where the command line says that it stands.
    """
    from winding_core.parameters import ParameterError, build, declarations
    from winding_ros.graph import PAGE, parameters_of
    from winding_ros.parameter_files import parameters_for

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


def operated_condition(condition: Condition, result: RunResult) -> Condition | None:
    """Return what the operator wound, as long as it was wound; None when nothing was.

    Args:
        condition: Of the command line.
        result: Of the session.
    """
    from winding_core.parameters import build, declarations

    reached = result.buffer.time
    if not result.wound or reached <= 0.0:
        return None
    names = {item.name for item in declarations(type(condition))}
    stated: Mapping[str, object] = {k: v for k, v in result.wound.items() if k in names}
    wound = build(type(condition), stated, owner="the run")
    return replace(wound, duration=min(wound.duration, reached))


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
