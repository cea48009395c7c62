"""Colours of the page in both themes, against WCAG 2.1."""

import re
from pathlib import Path

import numpy as np
import pytest
from test_drawings import contrast

import winding_dashboard
from winding_dashboard.drawings.palette import tension_colours

STYLE = (Path(winding_dashboard.__file__).parent / "data" / "page.css").read_text(encoding="utf-8")
TEXT = ("ink", "soft", "predicted", "corrected", "measured", "danger", "warn", "good")
GRAPHICS = ("edge", "focus", "predicted", "corrected", "measured")
FILLED = ("danger", "go", "ink")


def theme(name: str) -> dict[str, str]:
    blocks = re.findall(r":root \{(.*?)\}", STYLE, flags=re.DOTALL)
    light, dark = (dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", block)) for block in blocks)
    return {"light": light, "dark": {**light, **dark}}[name]


@pytest.mark.parametrize("name", ["light", "dark"])
@pytest.mark.parametrize("ground", ["paper", "tint"])
def test_text_has_four_and_a_half_and_graphics_have_three(name: str, ground: str) -> None:
    colours = theme(name)
    for text in TEXT:
        assert contrast(colours[text], colours[ground]) >= 4.5, text
    for graphic in GRAPHICS:
        assert contrast(colours[graphic], colours[ground]) >= 3.0, graphic


@pytest.mark.parametrize("name", ["light", "dark"])
def test_words_on_filled_buttons_can_be_read(name: str) -> None:
    colours = theme(name)
    for ground in ("danger", "go"):
        assert contrast(colours["on"], colours[ground]) >= 4.5, ground
    assert contrast(colours["paper"], colours["ink"]) >= 4.5


@pytest.mark.parametrize("name", ["light", "dark"])
def test_band_of_tolerance_leaves_the_curves_readable(name: str) -> None:
    colours = theme(name)
    for curve in ("predicted", "measured"):
        assert contrast(colours[curve], colours["band"]) >= 3.0, curve


def test_scale_of_the_tension_has_the_colours_of_the_cable() -> None:
    (scale,) = re.findall(r"linear-gradient\(to right, ([^)]*)\)", STYLE)
    stops = scale.split(", ")
    assert stops == tension_colours(np.linspace(0.0, 1.0, len(stops)))
