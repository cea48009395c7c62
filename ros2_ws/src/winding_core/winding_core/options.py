"""Parameters as people type them: by an option's name, in the unit that the name says."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping

from winding_core.parameters import (
    Declaration,
    ParameterError,
    Value,
    declarations,
    refuse_unknown,
)

# How a refusal writes the name of an option.
Spelling = Callable[[str], str]


def options(configuration: type) -> dict[str, Declaration]:
    """Return the declarations that people may type, by the option's name with its unit."""
    return {_key(item): item for item in declarations(configuration) if item.unit is not None}


def option_kinds(configuration: type) -> dict[str, type]:
    """Return the type of every option by its name: bool, int, float or str; str for a list."""
    return {key: option_kind(item) for key, item in options(configuration).items()}


def option_kind(item: Declaration) -> type:
    """Return the type of an option: numbers of a list are typed as one text, with commas."""
    return str if isinstance(item.default, list) else type(item.default)


def typed_declaration(key: str, item: Declaration, spelling: Spelling = str) -> Declaration:
    """Return a declaration in the unit that is typed; 0 stands for nothing else there."""
    return dataclasses.replace(
        item,
        title=spelling(key),
        default=_shown(item, item.default),
        low=None if item.low is None else _number(item, item.low),
        high=None if item.high is None else _number(item, item.high),
        otherwise="",
    )


def typed_values(
    configuration: type, typed: Mapping[str, object], spelling: Spelling = str
) -> dict[str, Value]:
    """Return what was typed in SI, by field.

    Args:
        configuration: Dataclass that declares the parameters.
        typed: By option; None where nothing was typed.
        spelling: How a refusal writes an option's name.

    Raises:
        ParameterError: An unknown option, a wrong type, or a value outside its range.
    """
    known = options(configuration)
    refuse_unknown(typed, known, owner="a winding")
    values = {}
    for key, value in typed.items():
        if value is None:
            continue
        item = known[key]
        stated = typed_declaration(key, item, spelling)
        taken = stated.convert(_listed(stated, value))
        if item.unit is not None and isinstance(taken, float):
            taken = item.unit.to_si(taken)
        elif item.unit is not None and isinstance(taken, list):
            taken = [item.unit.to_si(number) for number in taken]
        values[item.name] = taken
    return values


def _listed(item: Declaration, value: object) -> object:
    """Return the numbers of a list that was typed as text."""
    if not (isinstance(item.default, list) and isinstance(value, str)):
        return value
    try:
        return [float(word) for word in value.split(",")]
    except ValueError:
        raise ParameterError(
            f"{item.title} needs {len(item.default)} numbers with commas, got {value!r}"
        ) from None


def explained(item: Declaration) -> str:
    """Return what the help of an option says: meaning, unit, choices and default."""
    text = item.meaning[0].upper() + item.meaning[1:]
    if item.unit is not None and item.unit.symbol:
        text += f", in {item.unit.symbol}"
    if item.choices is not None:
        text += f": {', '.join(filter(None, item.choices))}"
    default = _shown(item, item.default)
    if item.otherwise:
        text += f"; otherwise {item.otherwise}"
    elif isinstance(default, float):
        text += f"; {default:g} by default"
    elif isinstance(default, list):
        text += f"; {','.join(f'{number:g}' for number in default)} by default"
    elif not isinstance(default, bool) and default != "":
        text += f"; {default} by default"
    return f"{text}."


def shown_values(configuration: type, values: Mapping[str, Value]) -> dict[str, Value]:
    """Return values [SI] of fields as they would be typed, by option."""
    return {
        key: _shown(item, values[item.name])
        for key, item in options(configuration).items()
        if item.name in values
    }


def _key(item: Declaration) -> str:
    suffix = item.unit.suffix if item.unit is not None else ""
    return f"{item.option}_{suffix}" if suffix else item.option


def _shown(item: Declaration, value: Value) -> Value:
    if isinstance(value, list):
        return [_number(item, number) for number in value]
    return _number(item, value) if isinstance(value, float) else value


def _number(item: Declaration, value: float) -> float:
    return value if item.unit is None else item.unit.from_si(value)
