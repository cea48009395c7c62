"""Command-line options that a dataclass declares."""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Callable
from typing import Any, TypeVar, get_type_hints

Options = TypeVar("Options")


def with_options(
    record: type[Options],
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Let a command take the fields of a dataclass as options of its own.

    Args:
        record: Frozen dataclass whose fields have defaults and are annotated for typer. The
            command takes one of them as its first argument; its other arguments stay as they are.
    """

    def wrap(command: Callable[..., None]) -> Callable[..., None]:
        first, *rest = inspect.signature(command).parameters.values()
        hints = get_type_hints(record, include_extras=True)
        own = get_type_hints(command, include_extras=True)
        fields = dataclasses.fields(record)  # type: ignore[arg-type]
        options = [
            inspect.Parameter(
                item.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=item.default,
                annotation=hints[item.name],
            )
            for item in fields
        ]
        others = [item.replace(annotation=own[item.name]) for item in rest]

        @functools.wraps(command)
        def call(**given: Any) -> None:
            values = {item.name: given.pop(item.name) for item in fields}
            command(**{first.name: record(**values)}, **given)

        signature = inspect.Signature([*options, *others])
        call.__signature__ = signature  # type: ignore[attr-defined]
        call.__annotations__ = {item.name: item.annotation for item in (*options, *others)}
        del call.__wrapped__
        return call

    return wrap
