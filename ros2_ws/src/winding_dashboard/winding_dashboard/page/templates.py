"""The page's HTML: the whole once, and its parts with every snapshot; all text is escaped."""

import math
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from winding_core.cable.cases import paper_cases
from winding_core.cable.condition import Condition
from winding_core.cable.wound_label import WoundLabel
from winding_core.lay.errors import turn_state
from winding_core.status import Level
from winding_core.units import MILLIMETRE
from winding_dashboard.drawings.run_charts import CHARTS
from winding_dashboard.page.cell import millimetres, number
from winding_dashboard.page.commands import LAY_CONTROL
from winding_dashboard.page.condition_form import FIELDS, LAWS, OWN_FIELDS, brief, hint, label
from winding_dashboard.page.session import LIMIT_LABELS
from winding_dashboard.state.marker_rows import MOST_MARKERS

_OWN = 0
# Word and style of a node's level, and style of a turn's state.
_LEVELS = {
    Level.OK: ("ok", "quiet"),
    Level.WARN: ("warning", "warn"),
    Level.ERROR: ("ERROR", "bad"),
    Level.STALE: ("silent", "warn"),
}
_TURNS = {"off": "bad", "partly seen": "warn"}
_PAGE, _PARTS = "page.html", "parts.html"


def _page_content() -> dict[str, Any]:
    """Return what the page's template shows."""
    return {
        "cases": _cases(),
        "laws": LAWS,
        "own_fields": [_field(key) for key in OWN_FIELDS],
        "further_fields": [_field(key) for key in FIELDS if key not in OWN_FIELDS],
        "limit_labels": LIMIT_LABELS,
        "charts": CHARTS,
        "most_markers": MOST_MARKERS,
        "modes": {mode.name.lower(): name for mode, name in LAY_CONTROL.items()},
    }


def _field(key: str) -> dict[str, Any]:
    item = FIELDS[key]
    text = isinstance(item.default, str)
    return {
        "key": key,
        "label": label(key),
        "text": text,
        "low": "" if text or item.low is None else f"{item.low:g}",
        "high": "" if text or item.high is None else f"{item.high:g}",
        "hint": "" if text else hint(item),
    }


def _cases() -> dict[int, str]:
    labels = (WoundLabel.of(Condition(case=case.number).resolved()) for case in paper_cases())
    rows = {
        label.case: brief(
            str(label.case),
            weight=label.weight,
            cylinder_mm=label.cylinder_diameter / MILLIMETRE,
            cable_mm=label.cable_diameter / MILLIMETRE,
        )
        for label in labels
    }
    return rows | {_OWN: "own condition"}


class Templates:
    """Renders what the page is made of."""

    def __init__(self) -> None:
        environment = Environment(
            loader=PackageLoader("winding_dashboard"),
            autoescape=True,
            undefined=StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        environment.filters |= {"number": number, "mm": millimetres}
        environment.tests["finite"] = math.isfinite
        environment.globals |= {"levels": _LEVELS, "turn_state": turn_state, "turn_styles": _TURNS}
        self._page = environment.get_template(_PAGE)
        self._parts = environment.get_template(_PARTS).module

    def page(self) -> str:
        """Return the page without any value of the run."""
        return self._page.render(_page_content())

    def part(self, name: str, shown: dict[str, Any]) -> str:
        """Return one part.

        Raises:
            AttributeError: There is no such part.
        """
        return str(getattr(self._parts, name)(**shown))
