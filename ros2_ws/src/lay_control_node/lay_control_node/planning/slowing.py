"""A motion is slowed where it asks too much: a smooth share of its speed over its own time."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ROUNDS = 60
# A motion that has to be slower than this share of its speed is planned anew.
_LEAST = 1.0e-3
# Nodes and weights of Gauss and Legendre's rule on 0..1, exact to the fifth power.
_NODES = 0.5 + 0.5 * np.sqrt(0.6) * np.array([-1.0, 0.0, 1.0])
_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0


class TooFastError(ValueError):
    """A motion must be slowed by more than can be found from its own time."""


@dataclass(frozen=True, kw_only=True)
class Slowing:
    """Share of the speed at which a motion is run through, over the motion's own time.

    A cubic B-spline: smooth to the second derivative, and never outside its coefficients.

    Attributes:
        step: Spacing of the coefficients [s] of the motion's own time.
        shares: Coefficients, shape (n,); share of the speed.
    """

    step: float
    shares: Array
    _times: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        inside = np.arange(self.shares.size - 1)
        slow = sum(
            weight / self.share((inside + node) * self.step)
            for node, weight in zip(_NODES, _WEIGHTS, strict=True)
        )
        times = np.concatenate([[0.0], np.cumsum(self.step * np.asarray(slow))])
        object.__setattr__(self, "_times", times)

    @property
    def end(self) -> float:
        """Real time at the last coefficient [s]."""
        return float(self._times[-1])

    def share(self, own: Array) -> Array:
        """Return the share of the speed at the motion's own times [s], same shape."""
        last = self.shares.size - 1
        at = np.clip(own / self.step, 0.0, float(last))
        k = np.minimum(at.astype(int), max(last - 1, 0))
        u = at - k
        c = [self.shares[np.clip(k + shift, 0, last)] for shift in (-1, 0, 1, 2)]
        weights = (
            (1.0 - u) ** 3 / 6.0,
            (3.0 * u**3 - 6.0 * u**2 + 4.0) / 6.0,
            (-3.0 * u**3 + 3.0 * u**2 + 3.0 * u + 1.0) / 6.0,
            u**3 / 6.0,
        )
        return np.asarray(sum(w * value for w, value in zip(weights, c, strict=True)))

    def real_time(self, own: Array) -> Array:
        """Return the real time [s] at the motion's own times [s], shape (m,)."""
        k = np.clip((own / self.step).astype(int), 0, self.shares.size - 2)
        rest = own - k * self.step
        more = sum(
            weight * rest / self.share(k * self.step + node * rest)
            for node, weight in zip(_NODES, _WEIGHTS, strict=True)
        )
        return np.asarray(self._times[k] + more)

    def own_time(self, real: Array) -> Array:
        """Return the motion's own time [s] at real times [s], shape (m,)."""
        own = np.interp(real, self._times, self.step * np.arange(self.shares.size))
        real = np.clip(real, 0.0, self.end)
        # Newton; the start is off by what a share changes within a step.
        for _ in range(4):
            own = own + (real - self.real_time(own)) * self.share(own)
            own = np.clip(own, 0.0, self.step * (self.shares.size - 1))
        return np.asarray(own)


def slowed(rates: tuple[tuple[Array, ...], ...], most: Array, step: float, reach: int) -> Slowing:
    """Return how a motion must be slowed so that every rate keeps its limit.

    Args:
        rates: Of each axis: first, second, and where limited third derivative over the motion's
            own time, shape (n,) each.
        most: Their limits in the same order, flat, shape (count of rates,).
        step: Of the motion's own time from sample to sample [s].
        reach: Samples over which the speed may change to either side.

    Raises:
        TooFastError: A limit is not kept at a thousandth of the speed.
    """
    cap = np.ones(rates[0][0].size)
    shares = cap
    for _ in range(_ROUNDS):
        shares = _smooth_below(cap, reach)
        asked = _asked(rates, most, _derivatives(shares, step))
        if (asked <= 1.0).all():
            return Slowing(step=step, shares=shares)
        cap = np.maximum(np.minimum(cap, shares / np.maximum(asked, 1.0) ** 1.02), 0.0)
        if cap.min() < _LEAST:
            break
    raise TooFastError("the motion is too fast to be slowed")


def _asked(rates: tuple[tuple[Array, ...], ...], most: Array, share: tuple[Array, ...]) -> Array:
    """Return by which factor the speed is too high everywhere, shape (n,)."""
    s, ds, dds = share
    asked = np.zeros(s.size)
    limits = iter(most.tolist())
    for axis in rates:
        first, second = axis[0], axis[1]
        actual = [first * s, second * s**2 + first * s * ds]
        if len(axis) > 2:
            actual.append(
                axis[2] * s**3 + 3.0 * second * s**2 * ds + first * (s * ds**2 + s**2 * dds)
            )
        for order, value in enumerate(actual, start=1):
            asked = np.maximum(asked, (np.abs(value) / next(limits)) ** (1.0 / order))
    return asked


def _derivatives(c: Array, step: float) -> tuple[Array, Array, Array]:
    padded = np.pad(c, 1, mode="edge")
    before, here, after = padded[:-2], padded[1:-1], padded[2:]
    return (
        (before + 4.0 * here + after) / 6.0,
        (after - before) / (2.0 * step),
        (after - 2.0 * here + before) / step**2,
    )


def _smooth_below(cap: Array, reach: int) -> Array:
    """Return the cap smoothed by a cubic kernel, nowhere above it, shape (n,)."""
    if (cap >= 1.0).all():
        return cap
    box = max(1, reach // 2)
    low = _running_min(cap, 2 * box + 1)
    for _ in range(4):
        sums = np.cumsum(np.pad(low, (box // 2 + 1, box - 1 - box // 2), mode="edge"))
        low = np.minimum((sums[box:] - sums[:-box]) / box, 1.0)
    return np.asarray(np.maximum(low, 0.1 * _LEAST))


def _running_min(values: Array, half: int) -> Array:
    """Return the smallest of each value and `half` neighbours to either side, shape (n,)."""
    width = 2 * half + 1
    padded = np.pad(values, half, mode="edge")
    count = -(-padded.size // width)
    padded = np.pad(padded, (0, count * width - padded.size), constant_values=np.inf)
    blocks = padded.reshape(count, width)
    forward = np.minimum.accumulate(blocks, axis=1).ravel()
    backward = np.minimum.accumulate(blocks[:, ::-1], axis=1)[:, ::-1].ravel()
    return np.minimum(backward[: values.size], forward[width - 1 : width - 1 + values.size])
