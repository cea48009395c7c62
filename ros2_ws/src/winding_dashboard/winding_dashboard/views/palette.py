"""Colours of the page: Okabe and Ito's for data, so that nobody needs to tell red from green."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

INK = "#1f2933"
SOFT = "#52606d"
LINE = "#d9dee4"
TINT = "#f5f7fa"
PAPER = "#ffffff"
FONT = "Segoe UI, Helvetica Neue, Noto Sans, DejaVu Sans, Arial, sans-serif"

PREDICTED = "#0072b2"
CORRECTED = "#007a5a"
MEASURED = "#d55e00"
SETPOINT = "#52606d"
DANGER = "#b3261e"

# viridis at nine even steps: monotone in lightness, so also readable in grey.
_STOPS = [
    "440154",
    "472c7a",
    "3b518b",
    "2c718e",
    "21908d",
    "27ad81",
    "5cc863",
    "aadc32",
    "fde725",
]
GRADIENT = f"linear-gradient(to right, {', '.join(f'#{stop}' for stop in _STOPS[::2])})"


def viridis(share: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return RGB, shape (n, 3) in [0, 1], of shares in [0, 1], shape (n,)."""
    colours = np.array([list(bytes.fromhex(stop)) for stop in _STOPS]) / 255.0
    stops = np.linspace(0.0, 1.0, len(colours))
    return np.stack([np.interp(share, stops, channel) for channel in colours.T], axis=1)
