"""With what parameters a node of a recorded run worked."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from winding_core.parameters import build, declarations
from winding_recorder.bags.failure import BagError
from winding_recorder.bags.notes import PARAMETERS
from winding_recorder.bags.reading import read_notes

Configuration = TypeVar("Configuration")


def recorded_parameters(path: Path, node: str) -> dict[str, Any]:
    """Return the parameters that a recording states of a node.

    Raises:
        BagError: It states none.
    """
    text = read_notes(path).get(f"{PARAMETERS}{node}") if path.is_dir() else None
    if text is None:
        raise BagError(f"{path} does not say with what parameters {node} ran")
    try:
        values = json.loads(text)
    except json.JSONDecodeError as error:
        raise BagError(f"the parameters of {node} in {path} are not JSON: {error}") from error
    if not isinstance(values, dict):
        raise BagError(f"the parameters of {node} in {path} are no mapping")
    return values


def configuration_of(
    stated: type[Configuration], values: Mapping[str, Any], node: str
) -> Configuration:
    """Return a node's configuration from recorded parameters.

    rclpy's own parameters, use_sim_time among them, do not change the work and are left out.

    Raises:
        ParameterError: A value is refused.
    """
    known = {item.name for item in declarations(stated)}
    own = {name: value for name, value in values.items() if name in known}
    return build(stated, own, owner=node)
