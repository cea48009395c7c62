"""Colours inside of pictures that stand on a dark ground in both themes of the page.

Curves take the page's colours by class (`data/page.css`); these are for what is drawn on the dark
ground of camera and cylinder.
"""

import numpy as np
from numpy.typing import NDArray

GROUND = "#10151a"
INK = "#1f2933"
PAPER = "#ffffff"
# Okabe and Ito's orange for what was measured, lighter than on paper.
MEASURED = "#f28e2b"
DANGER = "#ff6b5e"
DRUM, EDGE = "#242d36", "#8a97a5"

# viridis from its middle on, in even steps: monotone in lightness, so also readable in grey, and
# 3 : 1 or more against the drum.
_STOPS = ["21908d", "1fa187", "27ad81", "4ac16d", "7ad151", "bbdf27", "fde725"]


def tension_colours(share: NDArray[np.float64]) -> list[str]:
    """Return CSS colours of shares in [0, 1], shape (n,)."""
    colours = np.array([list(bytes.fromhex(stop)) for stop in _STOPS], dtype=float)
    stops = np.linspace(0.0, 1.0, len(colours))
    rgb = np.stack([np.interp(share, stops, channel) for channel in colours.T], axis=1)
    return [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in rgb.round().astype(int)]
