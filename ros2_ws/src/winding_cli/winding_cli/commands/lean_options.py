"""Options that are read without pydantic, which takes longer to import than a command to parse.

Typer hands it every option, typed or not. What was not typed and what is written plainly needs no
validation; anything else goes to Typer as before, which says what is wrong with it.
"""

from __future__ import annotations

import re
from typing import Any

from typer.core import TyperArgument, TyperCommand, TyperGroup, TyperOption

# Texts of which Python and pydantic make the same value.
_PLAIN = {
    int: re.compile(r"[+-]?(0|[1-9][0-9]{0,15})"),
    float: re.compile(r"[+-]?(0|[1-9][0-9]{0,15})(\.[0-9]{1,30})?(e[+-]?[0-9]{1,2})?"),
    str: re.compile(r".*", re.DOTALL),
}


class LeanCommand(TyperCommand):
    """A command whose plain options take no validation."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the options, that of help included."""
        return _shortened(super().get_params(ctx))


class LeanGroup(TyperGroup):
    """A group of commands whose own plain options take no validation."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the options, that of help included."""
        return _shortened(super().get_params(ctx))


def _shortened(items: list[Any]) -> list[Any]:
    for item in items:
        if isinstance(item, TyperOption | TyperArgument) and _alone(item):
            _shorten(item)
    return items


def _alone(item: TyperOption | TyperArgument) -> bool:
    """Return whether an option takes one value, which is not limited and has no parser."""
    kind = item.type_descriptor
    bound = kind.is_ranged or kind.is_choice or kind.parameter_info.parser is not None
    return item.nargs == 1 and not item.multiple and not bound


def _shorten(item: TyperOption | TyperArgument) -> None:
    if "process_value" in vars(item):
        return
    validated = item.process_value
    kind = item.type_descriptor.annotation
    plain = _PLAIN.get(kind)

    def process(ctx: Any, value: Any) -> Any:
        if item.callback is not None and value:
            return validated(ctx, value)
        if value is None and not item.required:
            return None
        if plain is not None and isinstance(value, str) and plain.fullmatch(value):
            return kind(value)
        if kind in _PLAIN and type(value) is kind:
            return value
        return validated(ctx, value)

    item.process_value = process  # type: ignore[method-assign]
