"""The wanted lay of a run, refused where no controller can lay it."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

from winding_core.parameters import ParameterError, build
from winding_core.run_spec import RunSpec

if TYPE_CHECKING:
    from lay_control_node.control.lay_controller import LayController


def lead_of(spec: RunSpec) -> float:
    """Return by how much the guide of a wanted lay goes ahead of the cable at first [m].

    Raises:
        ParameterError: The wanted lay cannot be read or used.
    """
    if not spec.controlled:
        return 0.0
    what = spec.condition.resolved()
    slope = _controller(spec).wanted.at(0.0).slope
    return slope * what.free_length / what.case.centreline_radius


def _controller(spec: RunSpec) -> LayController:
    from lay_control_node.ros.parameters import LayControlParameters

    own = {item.name: getattr(spec.condition, item.name) for item in fields(spec.condition)}
    wish = build(LayControlParameters, {**own, **spec.asked("lay")}, owner="winding run")
    try:
        return wish.new_controller()
    except ValueError as error:
        if spec.lay.program:
            raise ParameterError(f"{spec.source.label('program')}: {error}") from error
        spec.source.refuse("lay:", error)
