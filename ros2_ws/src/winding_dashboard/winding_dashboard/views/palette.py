"""Colours of the page: Okabe and Ito's for data, so that nobody needs to tell red from green."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

INK = "#1f2933"
SOFT = "#52606d"
LINE = "#d9dee4"
TINT = "#f5f7fa"
PAPER = "#ffffff"

PREDICTED = "#0072b2"
CORRECTED = "#007a5a"
MEASURED = "#d55e00"
SETPOINT = "#52606d"
DANGER = "#b3261e"

# viridis at nine even steps: monotone in lightness, so also readable in grey.
_VIRIDIS = (
    np.array(
        [
            [68, 1, 84],
            [71, 44, 122],
            [59, 81, 139],
            [44, 113, 142],
            [33, 144, 141],
            [39, 173, 129],
            [92, 200, 99],
            [170, 220, 50],
            [253, 231, 37],
        ]
    )
    / 255.0
)
GRADIENT = "linear-gradient(to right, #440154, #3b518b, #21908d, #5cc863, #fde725)"


def viridis(share: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return RGB, shape (n, 3) in [0, 1], of shares in [0, 1], shape (n,)."""
    stops = np.linspace(0.0, 1.0, len(_VIRIDIS))
    return np.stack([np.interp(share, stops, channel) for channel in _VIRIDIS.T], axis=1)
