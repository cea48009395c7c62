"""What `winding run` is told of the wanted lay, for the nodes that bring it about."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING

from winding_cli.commands.condition_options import Typed, spelled
from winding_core.condition import Condition
from winding_core.lay_wish import LayWish
from winding_core.options import typed_values
from winding_core.parameters import Value, build

if TYPE_CHECKING:
    from lay_control_node.control.lay_controller import LayController


def wish_of(typed: Typed, condition: Condition) -> dict[str, Value]:
    """Return the parameters of the wanted lay; nothing where no controller of the lay is asked for.

    Raises:
        ParameterError: A value is refused.
        LayProgramError: The program cannot be read or used.
    """
    values = typed_values(LayWish, typed, spelled)
    if values:
        _controller(values, condition)
    return values


def lead_of(wish: Mapping[str, Value], condition: Condition) -> float:
    """Return by how much the guide of a wanted lay goes ahead of the cable at first [m]."""
    if not wish:
        return 0.0
    what = condition.resolved()
    slope = _controller(wish, condition).wanted.at(0.0).slope
    return slope * what.free_length / what.case.centreline_radius


def _controller(wish: Mapping[str, Value], condition: Condition) -> LayController:
    from lay_control_node.ros.parameters import LayControlParameters

    own = {item.name: getattr(condition, item.name) for item in fields(condition)}
    return build(LayControlParameters, {**own, **wish}, owner="winding run").new_controller()


def controlled_nodes(wish: Mapping[str, Value]) -> dict[str, Mapping[str, Value]]:
    """Return what the nodes of a controlled run are told beside the condition, by node."""
    from lay_control_node.control.control_parameters import ControlParameters
    from winding_ros import topics

    return {
        topics.LAY_CONTROL: wish,
        topics.FEM: {"carriage_speed": ControlParameters().guide_speed_limit},
    }
