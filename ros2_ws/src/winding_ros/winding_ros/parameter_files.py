"""What a ROS parameter file says to one node."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from winding_core.yaml_text import YamlTextError, load_yaml

_PARAMETERS = "ros__parameters"


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
        content = load_yaml(file.read_text(encoding="utf-8"))
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
