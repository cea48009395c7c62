"""The wanted lay of a run, as typed and as parameters of the nodes that control it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

from winding_cli.terminal.record_options import Typed, spelled
from winding_core.cable.condition import Condition
from winding_core.lay.errors import LayTolerance
from winding_core.lay.program import LayProgramError
from winding_core.parameters import ParameterError, Value, build, typed_values
from winding_core.run_options import LayWish

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
        try:
            _controller(values, condition)
        except LayProgramError as error:
            if "program" in values:
                raise LayProgramError(f"--program: {error}") from error
            raise
    return values


@dataclass(frozen=True, kw_only=True)
class Held:
    """What a lay is held against."""

    limit: float  # Largest distance in every turn after the second [m]
    asked: bool  # Whether the user has set it: the run then fails where it is not kept

    @property
    def of_page(self) -> dict[str, object]:
        """Parameters of the operator's page."""
        return {"lay_tolerance": self.limit} if self.asked else {}


def tolerance_of(typed: Typed, wish: Mapping[str, Value]) -> Held:
    """Return what the lay of a run is held against.

    Raises:
        ParameterError: The tolerance is refused, or no lay is wanted.
    """
    if typed and not wish:
        raise ParameterError(
            "--lay-tolerance-mm judges a wanted lay: give --control, --program or --pitch-mm, too"
        )
    return held_against(typed)


def held_against(typed: Typed) -> Held:
    """Return what a lay is held against.

    Raises:
        ParameterError: The tolerance is refused.
    """
    values = typed_values(LayTolerance, typed, spelled)
    kept = build(LayTolerance, values, owner="winding run")
    return Held(limit=kept.lay_tolerance, asked=bool(values))


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
    """Return parameters of a controlled run beside the condition, by node."""
    from lay_control_node.control.control_parameters import ControlParameters
    from winding_ros import topics

    return {
        topics.LAY_CONTROL: wish,
        topics.FEM: {"carriage_speed": ControlParameters().guide_speed_limit},
    }
