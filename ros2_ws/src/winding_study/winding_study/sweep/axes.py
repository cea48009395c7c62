"""One swept parameter: a value, a list, a range or a random sample, with the right type."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

# More values or runs than this are a slip of the pen.
LIMIT = 1_000_000

Value = bool | int | float | str


class SpecError(ValueError):
    """A sweep's description cannot be used; the sentence says where and why."""


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
