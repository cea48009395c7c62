"""Units: everything is SI inside; people type and read millimetres and megapascals."""

import math
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any, TypeVar

Value = TypeVar("Value")

# One such unit in SI.
MILLIMETRE = 1.0e-3
MILLISECOND = 1.0e-3
MICROSECOND = 1.0e-6
MILLIRADIAN = 1.0e-3
MILLINEWTON = 1.0e-3
KILOPASCAL = 1.0e3
MEGAPASCAL = 1.0e6
MEGABYTE = 1.0e6


@dataclass(frozen=True, kw_only=True)
class Unit:
    """How a quantity is typed and shown."""

    symbol: str = ""  # Of the unit that is typed; empty for a pure number or a word.
    si: str = ""  # Of the SI unit that is stored.
    scale: float = 1.0  # One typed unit in SI.
    suffix: str = ""  # Of an option's name, that names what is typed; empty for none.
    path: bool = False  # Whether what is typed names a file or a folder.

    def to_si(self, typed: float) -> float:
        """Return a typed number in SI."""
        return typed * self.scale

    def from_si(self, value: float) -> float:
        """Return an SI number in the typed unit, to twelve digits.

        A change of units shall not show as 30.000000000000004.
        """
        return float(f"{value / self.scale:.12g}")


def known(value: Value) -> Value | None:
    """Return a value, or None in place of a number that is not finite, which JSON has not."""
    if not isinstance(value, Real) or isinstance(value, Integral):
        return value
    number: Any = float(value)
    return number if math.isfinite(number) else None


def json_values(record: object, *keys: str) -> dict[str, Any]:
    """Return attributes of a record as JSON values, None for a number that is not finite.

    Args:
        record: Has the attributes.
        keys: Each an attribute, or one with its unit behind it, such as `theta_rad` of `theta`.
    """
    return {
        key: known(getattr(record, key if hasattr(record, key) else key.rpartition("_")[0]))
        for key in keys
    }


PLAIN = Unit()
PATH = Unit(path=True)
LONG_LENGTH = Unit(symbol="m", si="m", suffix="m")
LENGTH = Unit(symbol="mm", si="m", scale=MILLIMETRE, suffix="mm")
STRESS = Unit(symbol="MPa", si="Pa", scale=MEGAPASCAL, suffix="mpa")
FORCE = Unit(symbol="N", si="N", suffix="n")
DENSITY = Unit(symbol="kg/m³", si="kg/m^3")
SPEED = Unit(symbol="mm/s", si="m/s", scale=MILLIMETRE, suffix="mm_s")
ANGULAR_SPEED = Unit(symbol="rad/s", si="rad/s", suffix="rad_s")
ACCELERATION = Unit(symbol="mm/s²", si="m/s^2", scale=MILLIMETRE, suffix="mm_s2")
ANGULAR_ACCELERATION = Unit(symbol="rad/s²", si="rad/s^2", suffix="rad_s2")
JERK = Unit(symbol="mm/s³", si="m/s^3", scale=MILLIMETRE, suffix="mm_s3")
TIME = Unit(symbol="s", si="s", suffix="s")
SHORT_TIME = Unit(symbol="ms", si="s", scale=MILLISECOND, suffix="ms")
ROW_TIME = Unit(symbol="µs", si="s", scale=MICROSECOND, suffix="us")
ANGLE = Unit(symbol="rad", si="rad", suffix="rad")
TURNS = Unit(symbol="turns", si="rad", scale=2.0 * math.pi, suffix="turns")
SMALL_ANGLE = Unit(symbol="mrad", si="rad", scale=MILLIRADIAN, suffix="mrad")
SIZE = Unit(symbol="MB", si="B", scale=MEGABYTE, suffix="mb")
HUE = Unit(symbol="deg", si="deg", suffix="deg")
