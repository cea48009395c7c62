"""What a ROS parameter file contains for one node."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.logging import LoggingSeverity, get_logger_effective_level, set_logger_level

from winding_core.yaml_text import PlainLoader, YamlTextError, load_yaml

_PARAMETERS = "ros__parameters"
# Names that rclpy itself accepts as overrides on every node.
_RCLPY_NAMES = ("use_sim_time", "start_type_description_service")
_RCLPY_PREFIX = "qos_overrides."


class _RclLoader(PlainLoader):
    """Numbers such as 1e3 and 1.5e3, which YAML 1.1 takes for texts and rcl for numbers."""


_RclLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]+"),
    list("-+0123456789"),
)


def check_readable(file: Path) -> None:
    """Have rcl itself parse a parameter file.

    Raises:
        ValueError: Why it refuses the file.
    """
    # rcl logs its refusal on stderr as well.
    level = get_logger_effective_level("rcl")
    set_logger_level("rcl", LoggingSeverity.FATAL)
    context = Context()
    try:
        context.init(
            args=["check", "--ros-args", "--params-file", str(file)], initialize_logging=False
        )
    except RuntimeError as error:
        reason = re.search(r"Error: (.*?)\s*, at ", str(error), re.DOTALL)
        raise ValueError(
            f"{file} is not a parameter file: {reason[1] if reason else 'rcl cannot read it'}"
        ) from error
    finally:
        set_logger_level("rcl", level)
        rclpy.try_shutdown(context=context)


def declared_names(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters that a node itself declares, without those of rclpy on every node."""
    return {
        name: value
        for name, value in values.items()
        if name not in _RCLPY_NAMES and not name.startswith(_RCLPY_PREFIX)
    }


def parameters_for(file: Path, node: str) -> dict[str, Any]:
    """Return the parameters that a file gives to a node, later entries over earlier ones.

    Args:
        file: A YAML file as rcl reads it: node names, nested or with slashes, `*` for one name
            and `**` for any number of them.
        node: Full node name.

    Raises:
        ValueError: It is not such a file.
    """
    try:
        content = load_yaml(file.read_text(encoding="utf-8"), _RclLoader)
    except (YamlTextError, UnicodeDecodeError) as error:
        raise ValueError(f"{file} is not a parameter file: {error}") from error
    if content is None:
        return {}
    if not isinstance(content, Mapping):
        raise ValueError(f"{file} is not a parameter file: it holds a {type(content).__name__}")
    return _collect(content, "", node)


def _collect(content: Mapping[str, Any], pattern: str, node: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in content.items():
        if not isinstance(value, Mapping):
            continue
        if name == _PARAMETERS:
            if _fits(pattern, node):
                found |= _flat(value, "")
        else:
            found |= _collect(value, f"{pattern}/{str(name).strip('/')}", node)
    return found


def _fits(pattern: str, node: str) -> bool:
    expression = "".join(
        {"**": "(/[^/]+)*", "*": "/[^/]+"}.get(token, "/" + re.escape(token))
        for token in pattern.strip("/").split("/")
    )
    return re.fullmatch(expression, node) is not None


def _flat(values: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{name}.")
        else:
            flat[f"{prefix}{name}"] = value
    return flat
