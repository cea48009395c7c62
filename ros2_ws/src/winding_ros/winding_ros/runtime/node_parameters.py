"""Declare a node's parameters from the dataclass that states them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from winding_core.parameters import Declaration, ParameterError, build, declarations, refuse_unknown
from winding_ros.runtime.parameter_files import declared_names

Configuration = TypeVar("Configuration")
# Of a node's constructor: rclpy lists overrides only once they are declared.
DECLARED_FROM_OVERRIDES = {"automatically_declare_parameters_from_overrides": True}


def declare_parameters(node: Node, configuration: type[Configuration]) -> Configuration:
    """Declare every parameter on a node and return the configuration with its overrides.

    Args:
        node: Made with DECLARED_FROM_OVERRIDES.
        configuration: Dataclass that states them.

    Raises:
        ParameterError: An override has an unknown name, a wrong type or is out of range.
    """
    overrides = declared_names(node.get_parameters_by_prefix(""))
    declared = {item.name: item for item in declarations(configuration)}
    refuse_unknown(overrides, declared, owner=f"node {node.get_fully_qualified_name()}")
    values: dict[str, object] = {}
    for name, item in declared.items():
        value = item.default
        if name in overrides:
            # A whole number in YAML would make rclpy refuse a double parameter.
            value = values[name] = item.convert(overrides[name].value)
            node.undeclare_parameter(name)
        node.declare_parameter(name, value, _descriptor(item), ignore_override=True)
    return build(configuration, values, owner=f"node {node.get_fully_qualified_name()}")


def read_parameters(node: Node, configuration: type[Configuration]) -> Configuration:
    """Return the configuration with the values that a node's parameters have now."""
    names = [item.name for item in declarations(configuration)]
    values = {name: node.get_parameter(name).value for name in names}
    return build(configuration, values, owner=f"node {node.get_fully_qualified_name()}")


def add_parameter_validation(node: Node, configuration: type, fixed: Callable[[], bool]) -> None:
    """Make later parameter changes answer with the declaration's own sentence.

    Args:
        node: Whose parameters.
        configuration: Dataclass that states them.
        fixed: Whether the node is at work, so that read-only parameters cannot change.
    """
    declared = {item.name: item for item in declarations(configuration)}

    def check(parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            item = declared.get(parameter.name)
            if item is None:
                continue
            try:
                if item.read_only and fixed():
                    raise ParameterError(
                        f"parameter {item.name} is fixed while the node is configured; "
                        "clean the node up first"
                    )
                item.convert(parameter.value)
            except ParameterError as error:
                return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(check)


def _descriptor(item: Declaration) -> ParameterDescriptor:
    # A read-only value may still be chosen before the node is configured; rcl's flag forbids
    # that too, so `add_parameter_validation` guards it.
    descriptor = ParameterDescriptor(name=item.name, description=item.description)
    if item.choices is not None:
        descriptor.additional_constraints = (
            f"one of {', '.join(choice or 'empty' for choice in item.choices)}"
        )
    bounded = item.low is not None and item.high is not None
    if bounded and isinstance(item.default, float):
        descriptor.floating_point_range = [
            FloatingPointRange(
                from_value=float(item.lowest or 0.0), to_value=float(item.high or 0.0)
            )
        ]
    elif bounded and isinstance(item.default, int) and not isinstance(item.default, bool):
        descriptor.integer_range = [
            IntegerRange(from_value=int(item.lowest or 0), to_value=int(item.high or 0), step=1)
        ]
    return descriptor
