"""Ends and ticks of a chart's vertical axis."""

from __future__ import annotations

import math

_INTERVALS = 4


def ticks(low: float, high: float, least: float) -> tuple[float, float, float]:
    """Return lower end, upper end and interval of an axis that holds low to high [its unit]."""
    height = max(high - low, least)
    middle = 0.5 * (low + high)
    below, above = middle - 0.52 * height, middle + 0.52 * height
    if low >= 0.0:
        below = max(below, 0.0)
    raw = (above - below) / _INTERVALS
    power = 10.0 ** math.floor(math.log10(raw))
    step = power * next(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= raw)
    ends = (step * math.floor(below / step), step * math.ceil(above / step))
    return round(ends[0], 9), round(ends[1], 9), step
