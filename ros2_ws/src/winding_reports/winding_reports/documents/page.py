"""What every report is made of: one HTML text with everything in it, one style sheet for all."""

import math
import re
from dataclasses import dataclass
from functools import cache
from typing import Any

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

PAGE = "index.html"
MISSING = "–"
_PACKAGE = "winding_reports"


@dataclass(frozen=True, kw_only=True)
class Tile:
    """One number in the head of a report."""

    label: str  # What it is
    value: str  # With its unit
    remark: str = ""  # Small print under it


def render_page(template: str, *, package: str = _PACKAGE, **content: Any) -> str:
    """Return a page that loads nothing from anywhere; everything that is not markup is escaped.

    Args:
        template: Name of a file in a package's folder of templates.
        package: Whose folder comes before the one with the parts of every page.
        content: What the template asks for; a name that is missing is an error.
    """
    return _environment(package).get_template(template).render(**content)


def fixed(value: float | None, digits: int, unit: float = 1.0, *, sign: str = "") -> str:
    """Return a number in a unit with so many decimals, or a dash where there is none.

    Args:
        value: In any unit; None or nan for none.
        digits: Decimals.
        unit: The shown unit in that of the value.
        sign: `+` where a positive number has its sign, too.
    """
    if value is None or not math.isfinite(value):
        return MISSING
    # Minus zero is noise.
    return f"{round(value / unit, digits) + 0.0:{sign}.{digits}f}"


def anchor(title: str) -> str:
    """Return the name under which a heading is linked."""
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")


@cache
def _environment(package: str) -> Environment:
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(package), PackageLoader(_PACKAGE)]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["anchor"] = anchor
    return environment
