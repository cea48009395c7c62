"""Parameters declared once: dataclass fields that carry type, default, range and meaning."""

import dataclasses
import difflib
import math
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, cast

from winding_core.units import Unit

Value = bool | int | float | str | list[float]
Configuration = TypeVar("Configuration")


_SHOWN = 120  # A sentence shows so much of what was given [characters]


class ParameterError(ValueError):
    """A parameter has an unknown name, a wrong type or a value outside its range."""


@dataclass(frozen=True, kw_only=True)
class Declaration:
    """One parameter as its dataclass field states it."""

    name: str  # Of the field and of the ROS parameter.
    default: Value  # Its type is the parameter's type.
    meaning: str  # What it is, without the unit.
    low: float | None  # Smallest allowed number; None for no limit.
    high: float | None  # Largest allowed number; None for no limit.
    choices: tuple[str, ...] | None  # Allowed texts; None for any.
    read_only: bool  # Whether the value is fixed once the node runs.
    otherwise: str  # What holds when the number is 0; empty where 0 is a number like others.
    unit: Unit | None  # How people type it; None where only parameter files set it.
    option: str  # Name under which people type it, without the unit.
    label: str  # What a form calls it.
    title: str  # What a refusal calls it.

    @property
    def type_name(self) -> str:
        """Name of the parameter's type as people read it."""
        return "float list" if isinstance(self.default, list) else type(self.default).__name__

    @property
    def description(self) -> str:
        """What it is, with the SI unit, and what 0 stands for."""
        unit = f" [{self.unit.si}]" if self.unit is not None and self.unit.si else ""
        return f"{self.meaning}{unit}" + (f"; 0 for {self.otherwise}" if self.otherwise else "")

    @property
    def lowest(self) -> float | None:
        """Smallest number that is taken, the 0 that stands for something else included."""
        return 0.0 if self.otherwise and self.low is not None else self.low

    def convert(self, value: object) -> Value:
        """Return a value of the declared type inside the declared range.

        A whole number is taken where a float is declared.

        Raises:
            ParameterError: Wrong type, NaN, or outside range or choices.
        """
        try:
            converted = self._typed(value)
        except OverflowError:
            raise ParameterError(f"{self.title} must be finite, got {_shown(value)}") from None
        if isinstance(converted, str):
            if self.choices is not None and converted not in self.choices:
                raise ParameterError(
                    f"{self.title} must be one of {', '.join(filter(None, self.choices))}, "
                    f"got {_shown(converted)}"
                )
            return converted
        for number in converted if isinstance(converted, list) else [converted]:
            self._check_range(number)
        return converted

    def _typed(self, value: object) -> Value:
        wanted = self.default
        if isinstance(wanted, bool):
            if isinstance(value, bool):
                return value
        elif isinstance(wanted, int):
            if isinstance(value, int) and not isinstance(value, bool):
                # ROS has whole numbers of 64 bits.
                if abs(value) >= 2**63:
                    raise OverflowError
                return value
        elif isinstance(wanted, float):
            if isinstance(value, int | float) and not isinstance(value, bool):
                return float(value)
        elif isinstance(wanted, str):
            if isinstance(value, str):
                return value
        elif isinstance(value, Iterable) and not isinstance(value, str):
            items = list(value)
            # Where none is the default, any number of them may be given.
            if (not wanted or len(items) == len(wanted)) and all(
                isinstance(item, int | float) and not isinstance(item, bool) for item in items
            ):
                return [float(item) for item in items]
            raise ParameterError(
                f"{self.title} must be a list of {len(wanted) or 'any'} numbers, "
                f"got {_shown(items)}"
            )
        raise ParameterError(f"{self.title} must be a {self.type_name}, got {_shown(value)}")

    def _check_range(self, number: float) -> None:
        if not math.isfinite(number):
            raise ParameterError(f"{self.title} must be finite, got {number}")
        if self.otherwise and number == 0.0:
            return
        if self.low is not None and number <= 0.0 < self.low:
            raise ParameterError(f"{self.title} must be positive, got {number:g}")
        if self.low is not None and number < self.low:
            raise ParameterError(f"{self.title} must be at least {self.low:g}, got {number:g}")
        if self.high is not None and number > self.high:
            raise ParameterError(f"{self.title} must be at most {self.high:g}, got {number:g}")


def parameter(
    default: Value,
    meaning: str,
    unit: Unit | None = None,
    low: float | None = None,
    high: float | None = None,
    *,
    choices: tuple[str, ...] | None = None,
    read_only: bool = True,
    otherwise: str = "",
    option: str = "",
    label: str = "",
) -> Any:
    """Return a dataclass field that is also a parameter declaration.

    Args:
        default: The value where none is set; its type is the parameter's type.
        meaning: What it is; with the unit where `unit` does not state it.
        unit: How people type it on a command line, in a sweep or in a form; None where only
            parameter files set it.
        low: Smallest allowed number [SI].
        high: Largest allowed number [SI].
        choices: Allowed texts.
        read_only: Whether the value is fixed once the node runs.
        otherwise: What holds when the number is 0, which is then allowed beside the range.
        option: Name of that option without its unit; the field's own when empty.
        label: What a form calls it; the field's name in words when empty.
    """
    metadata = {
        "meaning": meaning,
        "low": low,
        "high": high,
        "choices": choices,
        "read_only": read_only,
        "otherwise": otherwise,
        "unit": unit,
        "option": option,
        "label": label,
    }
    if isinstance(default, list):
        return dataclasses.field(default_factory=lambda: list(default), metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def declarations(configuration: type) -> tuple[Declaration, ...]:
    """Return the parameters that a configuration dataclass states."""
    return tuple(_declaration(item) for item in dataclasses.fields(configuration))


def _declaration(item: dataclasses.Field[Any]) -> Declaration:
    declared: dict[str, Any] = dict(item.metadata)
    declared["option"] = declared["option"] or item.name
    declared["label"] = declared["label"] or item.name.replace("_", " ").capitalize()
    title = f"parameter {item.name}"
    return Declaration(name=item.name, default=_default(item), title=title, **declared)


def _default(item: dataclasses.Field[Any]) -> Value:
    if item.default_factory is not dataclasses.MISSING:
        return cast(Value, item.default_factory())
    return cast(Value, item.default)


def refuse_unknown(names: Iterable[str], known: Iterable[str], *, owner: str) -> None:
    """Raise ParameterError for the first name that is not known, naming the nearest one."""
    known = sorted(known)
    for name in names:
        if name not in known:
            near = difflib.get_close_matches(name[:_SHOWN], known, n=1, cutoff=0.0)
            hint = f"; did you mean {near[0]}?" if near else ""
            word = name if name.isidentifier() and len(name) <= _SHOWN else _shown(name)
            raise ParameterError(f"{owner} has no parameter {word}{hint}")


def _shown(value: object) -> str:
    try:
        text = repr(value)
    except ValueError:
        # Python writes no whole number of more than 4300 digits.
        return "a number of thousands of digits"
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."


def build(
    configuration: type[Configuration], values: Mapping[str, object], *, owner: str
) -> Configuration:
    """Return a configuration from named values.

    Raises:
        ParameterError: An unknown name, a wrong type, or a value outside its range.
    """
    declared = {item.name: item for item in declarations(configuration)}
    refuse_unknown(values, declared, owner=owner)
    converted = {name: declared[name].convert(value) for name, value in values.items()}
    return configuration(**converted)


def declared_in(configuration: type, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return those of some values that a configuration declares, by name."""
    names = {item.name for item in declarations(configuration)}
    return {name: value for name, value in values.items() if name in names}


Spelling = Callable[[str], str]  # How a refusal writes the name of an option


def options(configuration: type) -> dict[str, Declaration]:
    """Return the declarations that people may type, by the option's name with its unit."""
    return {_key(item): item for item in declarations(configuration) if item.unit is not None}


def option_kinds(configuration: type) -> dict[str, type]:
    """Return the type of every option by its name, as `option_kind` has it."""
    return {key: option_kind(item) for key, item in options(configuration).items()}


def option_kind(item: Declaration) -> type:
    """Return the type of an option: numbers of a list are typed as one text, with commas."""
    if item.unit is not None and item.unit.path:
        return Path
    return str if isinstance(item.default, list) else type(item.default)


def typed_declaration(key: str, item: Declaration, spelling: Spelling = str) -> Declaration:
    """Return a declaration in the unit that is typed; 0 stands for nothing else there."""
    return dataclasses.replace(
        item,
        title=spelling(key),
        default=_typed(item, item.default),
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
        declared = typed_declaration(key, item, spelling)
        taken = declared.convert(_listed(declared, value))
        if item.unit is not None and isinstance(taken, float):
            taken = item.unit.to_si(taken)
        elif item.unit is not None and isinstance(taken, list):
            taken = [item.unit.to_si(number) for number in taken]
        values[item.name] = taken
    return values


def typed_record(
    configuration: type[Configuration], typed: Mapping[str, object], spelling: Spelling = str
) -> Configuration:
    """Return a configuration of what was typed; see `typed_values`."""
    values: dict[str, Any] = typed_values(configuration, typed, spelling)
    return configuration(**values)


def _listed(item: Declaration, value: object) -> object:
    """Return the numbers of a list that was typed as text, and the text of a path."""
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if not (isinstance(item.default, list) and isinstance(value, str)):
        return value
    try:
        return [float(word) for word in value.split(",")]
    except ValueError:
        raise ParameterError(
            f"{item.title} needs {len(item.default)} numbers with commas, got {value!r}"
        ) from None


def explained(item: Declaration) -> str:
    """Return the help of an option: meaning, unit, choices and default."""
    text = item.meaning[0].upper() + item.meaning[1:]
    if item.unit is not None and item.unit.symbol:
        text += f", in {item.unit.symbol}"
    if item.choices is not None:
        text += f": {', '.join(filter(None, item.choices))}"
    default = _typed(item, item.default)
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
        key: _typed(item, values[item.name])
        for key, item in options(configuration).items()
        if item.name in values
    }


def _key(item: Declaration) -> str:
    suffix = item.unit.suffix if item.unit is not None else ""
    return f"{item.option}_{suffix}" if suffix else item.option


def _typed(item: Declaration, value: Value) -> Value:
    if isinstance(value, list):
        return [_number(item, number) for number in value]
    return _number(item, value) if isinstance(value, float) else value


def _number(item: Declaration, value: float) -> float:
    return value if item.unit is None else item.unit.from_si(value)
