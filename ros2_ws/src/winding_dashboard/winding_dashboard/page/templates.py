"""The page's HTML: the whole once, and its parts with every snapshot; all text is escaped."""

from __future__ import annotations

from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

_PAGE, _PARTS = "page.html", "parts.html"


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
        self._page = environment.get_template(_PAGE)
        self._parts = environment.get_template(_PARTS).module

    def page(self, shown: dict[str, Any]) -> str:
        """Return the page without any value of the run."""
        return self._page.render(shown)

    def part(self, name: str, shown: dict[str, Any]) -> str:
        """Return one part.

        Raises:
            AttributeError: There is no such part.
        """
        return str(getattr(self._parts, name)(**shown))
