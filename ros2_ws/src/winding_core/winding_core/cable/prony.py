"""Prony series: how the tension of a stretched cable fades, and how a loaded cable creeps."""

import math
import re
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Times that a term may have [s]: longer than a solver's step, shorter than a century.
SHORTEST, LONGEST = 1.0e-3, 3.0e9
# With less left of the stress for ever, creep under a load has no useful end.
LEAST_LEFT = 0.05
MOST_TERMS = 8


@dataclass(frozen=True, kw_only=True)
class PronySeries:
    """Shares of the stress at once that fade with a time each; none for an elastic cable.

    A cable that is held at a stretch carries the share
    1 - sum_i g_i (1 - exp(-t / tau_i)) of the law's stress at once. Under any history the
    stress is P0 - sum_i q_i with tau_i dq_i/dt + q_i = g_i P0, P0 the law's stress at the stretch
    of now: Simo's viscoelasticity in one dimension, for one term the standard linear solid.
    """

    shares: tuple[float, ...] = ()  # g_i, positive, their sum at most 1 - LEAST_LEFT, shape (n,)
    times: tuple[float, ...] = ()  # tau_i [s], shape (n,)

    def __post_init__(self) -> None:
        if len(self.shares) != len(self.times):
            raise ValueError(
                f"prony needs as many shares as times, got {len(self.shares)} and {len(self.times)}"
            )
        if len(self.shares) > MOST_TERMS:
            raise ValueError(f"prony takes at most {MOST_TERMS} terms, got {len(self.shares)}")
        for share, time in zip(self.shares, self.times, strict=True):
            if not (math.isfinite(share) and share > 0.0):
                raise ValueError(f"prony needs shares above 0, got {share:g}")
            if not SHORTEST <= time <= LONGEST:
                raise ValueError(
                    f"prony needs times of {SHORTEST:g} to {LONGEST:g} s, got {time:g} s"
                )
        if not self.left >= LEAST_LEFT:
            raise ValueError(
                f"the shares of prony must add up to at most {1.0 - LEAST_LEFT:g}, "
                f"got {1.0 - self.left:g}"
            )

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read terms `share:time`, joined by a plus: 0.2:1.5+0.1:30; nothing is elastic.

        Raises:
            ValueError: The text is something else, or a number is outside its limits.
        """
        shares, times = [], []
        # The plus of an exponent, as in 1e+3, joins nothing.
        for term in re.split(r"(?<![eE])\+", text) if text.strip() else []:
            share, colon, time = term.partition(":")
            try:
                shares.append(float(share))
                times.append(float(time))
            except ValueError:
                colon = ""
            if not colon:
                raise ValueError(
                    f"prony needs terms share:seconds joined by +, as 0.2:1.5+0.1:30, got {text!r}"
                )
        return cls(shares=tuple(shares), times=tuple(times))

    @property
    def left(self) -> float:
        """Share of the stress that a cable held at a stretch keeps for ever."""
        return 1.0 - math.fsum(self.shares)

    def creep(self, t: ArrayLike) -> NDArray[np.float64]:
        """Return by what factor a load held for times [s] acts as one put on at once, same shape.

        A cable under a dead load F is as long after a time as F times this makes it at once; for
        one term it is 1 + g / (1 - g) (1 - exp(-(1 - g) t / tau)).
        """
        times = np.maximum(np.asarray(t, dtype=float), 0.0)
        if not self.shares:
            return np.ones_like(times)
        g, tau = np.array(self.shares), np.array(self.times)
        # q / F grows by dy/dt = M y + g / tau; scaled by s the matrix is symmetric.
        s = np.sqrt(g / tau)
        rates, modes = np.linalg.eigh(np.outer(s, s) - np.diag(1.0 / tau))
        last = g / self.left
        start = modes.T @ (last / s)
        reached = (modes.T @ s) * start
        grown = -np.expm1(np.multiply.outer(times, rates)) @ reached
        return np.asarray(1.0 + grown)
