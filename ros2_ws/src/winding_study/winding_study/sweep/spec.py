"""What a sweep varies: a YAML text becomes the options of every run, in order and with type."""

import difflib
import hashlib
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import yaml

from winding_core.yaml_text import PlainLoader, YamlTextError, load_yaml

LIMIT = 1_000_000  # More values or runs than this are a slip of the pen

Value = bool | int | float | str
GRID, ZIP = "grid", "zip"


class SpecError(ValueError):
    """A sweep's description cannot be used; the sentence names place and reason."""


def axis_values(name: str, kind: type, given: object) -> list[Value]:
    """Return the values of one parameter.

    Args:
        name: The parameter.
        kind: Its type: bool, int, float or str.
        given: A value; a list of values; `{from, to, count, spacing}` with spacing linear or
            log; or `{random: uniform, low, high, count, seed}` or
            `{random: normal, mean, deviation, count, seed}`.

    Raises:
        SpecError: Wrong type, unknown or missing words, or an impossible range.
    """
    if isinstance(given, list):
        if not given:
            raise SpecError(f"{name} has an empty list of values")
        return [typed(name, kind, value) for value in given]
    if not isinstance(given, Mapping):
        return [typed(name, kind, given)]
    if kind not in (int, float):
        raise SpecError(f"{name} is no number: give its values as a list")
    if "random" in given:
        return _sample(name, kind, given)
    return _range(name, kind, given)


def typed(name: str, kind: type, value: object) -> Value:
    """Return a value of the declared type; a whole number is taken where a float is declared.

    Raises:
        SpecError: The value has another type or is not finite.
    """
    if kind is float and isinstance(value, int | float) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise SpecError(f"{name} must be finite, got {number}")
        return number
    if kind is int and isinstance(value, int) and not isinstance(value, bool):
        return value
    if kind in (bool, str) and isinstance(value, kind):
        return value
    words = {float: "a number", int: "a whole number", bool: "true or false", str: "a word"}
    hint = ""
    if isinstance(value, str) and kind is float and _reads_as_number(value):
        hint = "; YAML wants a point in it, as in 1.0e-3"
    raise SpecError(f"{name} must be {words[kind]}, got {value!r}{hint}")


def _range(name: str, kind: type, given: Mapping[Any, Any]) -> list[Value]:
    _refuse_words(name, given, needed=("from", "to", "count"), more=("spacing",))
    low, high = (_number(f"{word} of {name}", given[word]) for word in ("from", "to"))
    count = _count(name, given["count"])
    spacing = given.get("spacing", "linear")
    if spacing not in ("linear", "log"):
        raise SpecError(f"spacing of {name} must be linear or log, got {spacing!r}")
    if spacing == "log" and min(low, high) <= 0.0:
        raise SpecError(f"{name} has log spacing, so from and to must be positive")
    if not math.isfinite(high - low):
        raise SpecError(f"from and to of {name} are too far apart, got {low:g} and {high:g}")
    numbers = (np.linspace if spacing == "linear" else np.geomspace)(low, high, count)
    if kind is float:
        return [float(number) for number in numbers]
    fraction = next((number for number in numbers if number != round(number)), None)
    if fraction is not None:
        raise SpecError(f"{name} must be a whole number, but the range holds {fraction:g}")
    return [int(number) for number in numbers]


def _sample(name: str, kind: type, given: Mapping[Any, Any]) -> list[Value]:
    if kind is not float:
        raise SpecError(f"{name} is a whole number: give its values as a list, not at random")
    shape = given["random"]
    draws: dict[str, tuple[tuple[str, str], Callable[..., Any]]] = {
        "uniform": (("low", "high"), np.random.Generator.uniform),
        "normal": (("mean", "deviation"), np.random.Generator.normal),
    }
    if not isinstance(shape, str) or shape not in draws:
        raise SpecError(f"random of {name} must be uniform or normal, got {shape!r}")
    words, draw = draws[shape]
    _refuse_words(name, given, needed=("random", *words, "count", "seed"), more=())
    one, two = (_number(f"{word} of {name}", given[word]) for word in words)
    if not math.isfinite(two - one):
        raise SpecError(f"{words[0]} and {words[1]} of {name} are too far apart")
    if shape == "uniform" and one > two:
        raise SpecError(f"low of {name} must not exceed high, got {one:g} and {two:g}")
    if shape == "normal" and two < 0.0:
        raise SpecError(f"deviation of {name} must not be negative, got {two:g}")
    count, seed = _count(name, given["count"]), given["seed"]
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        raise SpecError(f"seed of {name} must be a whole number from 0, got {seed!r}")
    # Two parameters with the same seed must not move together.
    own = int.from_bytes(hashlib.sha256(name.encode("utf-8")).digest()[:8], "little")
    rng = np.random.default_rng([seed, own])
    return [_number(f"a sample of {name}", float(number)) for number in draw(rng, one, two, count)]


def _refuse_words(
    name: str, given: Mapping[Any, Any], *, needed: tuple[str, ...], more: tuple[str, ...]
) -> None:
    for word in given:
        if word not in needed + more:
            raise SpecError(f"{name} has no word {word!r}; it takes {', '.join(needed + more)}")
    missing = [word for word in needed if word not in given]
    if missing:
        raise SpecError(f"{name} lacks {', '.join(missing)}")


def _number(name: str, value: object) -> float:
    number = typed(name, float, value)
    assert isinstance(number, float)
    return number


def _count(name: str, value: object) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= LIMIT:
        raise SpecError(f"count of {name} must be a whole number from 1 to {LIMIT}, got {value!r}")
    return value


def _reads_as_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


@dataclass(frozen=True, kw_only=True)
class SweepSpec:
    """A sweep's parameters with their values."""

    # Values of each parameter that is named, in the text's order.
    axes: Mapping[str, tuple[Value, ...]]
    # `grid`, every value with every other, the last parameter fastest; or `zip`, first values
    # together, second values together, single values with all.
    combine: str

    def __len__(self) -> int:
        counts = [len(values) for values in self.axes.values()]
        return math.prod(counts) if self.combine == GRID else max(counts)

    def __iter__(self) -> Iterator[dict[str, Value]]:
        rows: Iterable[tuple[Value, ...]]
        if self.combine == GRID:
            rows = itertools.product(*self.axes.values())
        else:
            repeated = (values * (len(self) // len(values)) for values in self.axes.values())
            rows = zip(*repeated, strict=True)
        for row in rows:
            yield dict(zip(self.axes, row, strict=True))

    @property
    def varied(self) -> tuple[str, ...]:
        """Names of the parameters with more than one value."""
        return tuple(name for name, values in self.axes.items() if len(values) > 1)


def parse_spec(text: str, kinds: Mapping[str, type]) -> SweepSpec:
    """Read a sweep's description.

    Args:
        text: YAML with `parameters` (see `axes.axis_values`) and, where wanted, `combine`.
        kinds: Type of every parameter that may be swept.

    Raises:
        SpecError: The text cannot be used.
    """
    try:
        content = load_yaml(text, _StrictLoader)
    except YamlTextError as error:
        raise SpecError(f"it is no YAML: {error}") from error
    if not isinstance(content, dict) or not isinstance(content.get("parameters"), dict):
        raise SpecError("it must hold a mapping named parameters")
    for word in content:
        if word not in ("parameters", "combine"):
            raise SpecError(f"it holds {word!r}; it may hold parameters and combine")
    combine = content.get("combine", GRID)
    if combine not in (GRID, ZIP):
        raise SpecError(f"combine must be {GRID} or {ZIP}, got {combine!r}")
    given = content["parameters"]
    if not given:
        raise SpecError("it names no parameter")
    axes = {name: _axis(name, value, kinds) for name, value in given.items()}
    spec = SweepSpec(axes=axes, combine=combine)
    if combine == ZIP:
        lengths = {name: len(values) for name, values in axes.items() if len(values) > 1}
        if len(set(lengths.values())) > 1:
            counts = ", ".join(f"{name} {count}" for name, count in lengths.items())
            raise SpecError(f"zip needs as many values of each parameter, got {counts}")
    if len(spec) > LIMIT:
        raise SpecError(f"it has {len(spec)} runs, more than {LIMIT}")
    return spec


def _axis(name: object, value: object, kinds: Mapping[str, type]) -> tuple[Value, ...]:
    if name not in kinds or not isinstance(name, str):
        near = difflib.get_close_matches(str(name), list(kinds), n=1, cutoff=0.0)
        raise SpecError(f"there is no parameter {name}; did you mean {near[0]}?")
    return tuple(axis_values(name, kinds[name], value))


class _StrictLoader(PlainLoader):
    """The plain loader, but a name that stands twice is an error."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        names: set[str] = set()
        for key, _ in node.value:
            name = self.construct_object(key, deep=True)
            if not isinstance(name, str):
                raise yaml.YAMLError(f"a name must be a word, got {name!r}{node.start_mark}")
            if name in names:
                raise yaml.YAMLError(f"{name} stands twice{node.start_mark}")
            names.add(name)
        return super().construct_mapping(node, deep)
