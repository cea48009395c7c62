"""A chart of curves and dots over one axis, as the inside of an SVG element."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

_INTERVALS = 4
Points = Sequence[Sequence[float | None]]
_LEFT, _RIGHT, _TOP, _BOTTOM = 44.0, 8.0, 8.0, 20.0
_LETTER = 6.2
_MOST_POINTS = 200  # Drawn of a curve at most; a chart is some 300 pixels wide


class Ends(NamedTuple):
    """Of an axis, in its unit."""

    low: float  # Lower end
    high: float  # Upper end
    step: float  # Distance of its ticks


def ticks(low: float, high: float, least: float) -> Ends:
    """Return an axis that holds low to high and a height at least [its unit]."""
    height = max(high - low, least)
    middle = 0.5 * (low + high)
    below, above = middle - 0.52 * height, middle + 0.52 * height
    if low >= 0.0:
        below = max(below, 0.0)
    raw = (above - below) / _INTERVALS
    power = 10.0 ** math.floor(math.log10(raw))
    step = power * next(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= raw)
    ends = (step * math.floor(below / step), step * math.ceil(above / step))
    return Ends(round(ends[0], 9), round(ends[1], 9), step)


@dataclass(frozen=True, kw_only=True)
class Curve:
    """One curve."""

    points: Points  # [x, y] in the axes' units; None where there is no value
    style: str  # CSS classes
    dots: bool = False  # Drawn as dots and not as a line


@dataclass(frozen=True, kw_only=True)
class Band:
    """A range of the vertical axis between two places of the horizontal one."""

    x: tuple[float, float]  # From and to, in the axis's unit
    y: tuple[float, float]  # From and to, in the axis's unit


def ends_of(curves: Sequence[Curve], least: float, *within: float) -> Ends:
    """Return a vertical axis that holds all curves and some values.

    Args:
        curves: In the axis's unit.
        least: Smallest height, in that unit: noise stays small.
        within: Values that it must hold, too, in that unit.
    """
    values = [y for curve in curves for _, y in curve.points if y is not None]
    found = [*values, *within]
    if not found:
        return Ends(0.0, max(least, 1.0), max(least, 1.0))
    return ticks(min(found), max(found), least)


def chart(
    curves: Sequence[Curve],
    x: Ends,
    y: Ends,
    *,
    size: tuple[float, float] = (320.0, 150.0),
    unit: str = "",
    bands: Sequence[Band] = (),
) -> str:
    """Return the drawing.

    Args:
        curves: Drawn in this order.
        x: Horizontal axis.
        y: Vertical axis.
        size: Width and height of the drawing's view box [px].
        unit: Behind the horizontal axis's numbers.
        bands: Drawn below the curves.
    """
    width, height = size
    right, bottom = width - _RIGHT, height - _BOTTOM

    def across(value: float) -> float:
        return _LEFT + (right - _LEFT) * (value - x.low) / (x.high - x.low)

    def up(value: float) -> float:
        return bottom - (bottom - _TOP) * (value - y.low) / (y.high - y.low)

    parts = [_band(band, across, up) for band in bands]
    for value in _steps(y):
        v = up(value)
        parts.append(f'<path class="grid" d="M{_LEFT:g} {v:.1f}H{right:g}"/>')
        parts.append(
            f'<text x="{_LEFT - 5:g}" y="{v + 3.8:.1f}" text-anchor="end">{_text(value)}</text>'
        )
    parts.append(f'<path class="axis" d="M{_LEFT:g} {bottom:g}H{right:g}"/>')
    for value in _steps(x):
        u = across(value)
        label = f"{_text(value)}{unit}"
        # The last label must not leave the drawing.
        u = min(u, width - 0.5 * _LETTER * len(label))
        parts.append(f'<text x="{u:.1f}" y="{height - 5:g}" text-anchor="middle">{label}</text>')
    for curve in curves:
        parts.append(_dots(curve, across, up) if curve.dots else _line(curve, across, up))
    return "".join(parts)


def _band(band: Band, across: Callable[[float], float], up: Callable[[float], float]) -> str:
    (left, right), (low, high) = map(across, band.x), map(up, band.y)
    return (
        f'<rect class="band-of-tolerance" x="{left:.1f}" y="{high:.1f}" '
        f'width="{max(right - left, 0.0):.1f}" height="{low - high:.1f}"/>'
    )


def _line(curve: Curve, across: Callable[[float], float], up: Callable[[float], float]) -> str:
    pieces: list[list[str]] = [[]]
    for u, v in _thinned(curve.points):
        if u is None or v is None:
            pieces.append([])
        else:
            pieces[-1].append(f"{across(u):.1f} {up(v):.1f}")
    path = "".join(f"M{'L'.join(piece)}" for piece in pieces if len(piece) > 1)
    return f'<path class="curve {curve.style}" d="{path}"/>' if path else ""


def _dots(curve: Curve, across: Callable[[float], float], up: Callable[[float], float]) -> str:
    # A line of no length with round ends is a dot, and one path draws them all.
    path = "".join(
        f"M{across(u):.1f} {up(v):.1f}h0"
        for u, v in curve.points
        if u is not None and v is not None
    )
    return f'<path class="dots {curve.style}" d="{path}"/>' if path else ""


def _thinned(points: Points) -> Points:
    every = math.ceil(len(points) / _MOST_POINTS) or 1
    kept = list(points[::every])
    if points and (len(points) - 1) % every:
        kept.append(points[-1])
    return kept


def _steps(axis: Ends) -> list[float]:
    count = math.floor((axis.high - axis.low) / axis.step + 1.0e-6)
    return [axis.low + axis.step * i for i in range(count + 1)]


def _text(value: float) -> str:
    # Minus zero is noise.
    return f"{round(value, 6) + 0.0:g}"
