"""The wanted lay of a run, as typed and as parameters of the nodes that control it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

from winding_cli.terminal.record_options import Typed, spelled
from winding_core.lay.errors import LayTolerance
from winding_core.parameters import ParameterError, Value, build, typed_values
from winding_core.run_spec import RunSpec

if TYPE_CHECKING:
    from lay_control_node.control.lay_controller import LayController


@dataclass(frozen=True, kw_only=True)
class Held:
    """What a lay is held against."""

    limit: float  # Largest distance in every turn after the second [m]
    asked: bool  # Whether the user has set it: the run then fails where it is not kept

    @property
    def of_page(self) -> dict[str, object]:
        """Parameters of the operator's page."""
        return {"lay_tolerance": self.limit} if self.asked else {}


def held_against(typed: Typed) -> Held:
    """Return what a lay is held against.

    Raises:
        ParameterError: The tolerance is refused.
    """
    values = typed_values(LayTolerance, typed, spelled)
    kept = build(LayTolerance, values, owner="winding run")
    return Held(limit=kept.lay_tolerance, asked=bool(values))


def lead_of(spec: RunSpec) -> float:
    """Return by how much the guide of a wanted lay goes ahead of the cable at first [m]."""
    if not spec.controlled:
        return 0.0
    what = spec.condition.resolved()
    slope = _controller(spec).wanted.at(0.0).slope
    return slope * what.free_length / what.case.centreline_radius


def controlled_nodes(spec: RunSpec) -> dict[str, Mapping[str, Value]]:
    """Return parameters of a run with a wanted lay beside the condition, by node.

    Raises:
        ParameterError: The wanted lay cannot be read or used.
    """
    from lay_control_node.control.control_parameters import ControlParameters
    from winding_ros import topics

    _controller(spec)
    return {
        topics.LAY_CONTROL: spec.asked("lay"),
        topics.FEM: {"carriage_speed": ControlParameters().guide_speed_limit},
    }


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
