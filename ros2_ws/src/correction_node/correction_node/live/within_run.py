"""Within a run: where the next markers will lie, from those that have been measured."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from correction_node.models.dataset import Array

# Two measured markers give the length of a turn and its growth; one gives only the length.
FEWEST = 2
_BUILD_UP_LENGTH = 0.1450459750961868
_RELATIVE_BOUNDS = (0.051487241616152105, 0.04008179934542152)


@dataclass(frozen=True, kw_only=True)
class LengthAhead:
    """The expected length of a marker that has not been measured."""

    s: float  # Curve length S_n [m]
    ahead: float  # How far it lies beyond the last measured marker [m]; 0 < ahead <= s
    measured: int  # How many measured markers it was found from


@dataclass(frozen=True, kw_only=True)
class WithinRun:
    """The increments of a run grow into a final value over a length that all runs share.

    With r_j = (S_j - S_(j-1)) / (S_FEM_j - S_FEM_(j-1)),

        r_j = r_inf - A exp(-s_(j-1) / L_c),   s_j = j spacings of undeformed cable,

    which is what a span tension that builds up exponentially does to a sticking cable
    (`winding_core.machine.tension.RigTension`). r_inf and A belong to the run and are fitted to its
    measured increments, so nothing is asked about cable, cylinder or weight; two markers fix
    them, more are fitted by least squares. L_c is the only number learned from other runs.
    """

    build_up_length: float  # L_c [m] of undeformed cable
    # Largest error over `ahead` of the left-out cases, with two measured markers and with three;
    # more markers than that keep the last. Empty for a law that is only fitted.
    relative_bounds: tuple[float, ...] = ()

    def length_ahead(
        self, marker: int, *, spacing: float, predicted: ArrayLike, measured: ArrayLike
    ) -> LengthAhead | None:
        """Return the expected length of a marker, or None with fewer than two measured ones.

        Only markers before the asked one are used.

        Args:
            marker: n of the asked marker.
            spacing: Marker spacing along the undeformed cable [m].
            predicted: S_FEM of P1, P2, ... [m], at least n of them; NaN where there is none.
            measured: S of P1, P2, ... [m]; NaN where it is not measured.
        """
        s_fem = np.concatenate([[0.0], np.asarray(predicted, dtype=float)])
        s = np.concatenate([[0.0], np.asarray(measured, dtype=float)])[:marker]
        known = np.flatnonzero(np.isfinite(s) & np.isfinite(s_fem[: len(s)]))
        if len(known) <= FEWEST or not math.isfinite(s_fem[marker]):
            return None
        # exp(-s / L_c) at the start of each spacing, and its sum up to each marker.
        decay = np.exp(-spacing / self.build_up_length * np.arange(marker))
        decayed = np.concatenate([[0.0], np.cumsum(decay)])
        grown = np.diff(decayed[known]) / np.diff(known)
        ratio = np.diff(s[known]) / np.diff(s_fem[known])
        slope, final = _line(grown, ratio)
        last = int(known[-1])
        mean_decay = (decayed[marker] - decayed[last]) / (marker - last)
        ahead = float((final + slope * mean_decay) * (s_fem[marker] - s_fem[last]))
        return LengthAhead(s=float(s[last]) + ahead, ahead=ahead, measured=len(known) - 1)

    def half_width(self, expected: LengthAhead) -> float:
        """Return the half-width of the interval around an expected length [m].

        Raises:
            ValueError: The length was found from fewer than two markers.
        """
        if expected.measured < FEWEST:
            raise ValueError(f"a bound needs {FEWEST} measured markers, got {expected.measured}")
        last = len(self.relative_bounds) - 1
        return self.relative_bounds[min(expected.measured - FEWEST, last)] * expected.ahead


def _line(x: Array, y: Array) -> tuple[float, float]:
    """Return (slope, intercept) of the least-squares line; slope 0 where all x are one."""
    dx = x - x.mean()
    spread = float(dx @ dx)
    slope = float(dx @ (y - y.mean())) / spread if spread > 0.0 else 0.0
    return slope, float(y.mean() - slope * x.mean())


def published_within_run() -> WithinRun:
    """Return the law learned from the paper's twelve runs and this project's rod.

    They come from `winding_verification.correction.within_run_score`, which takes too long for a
    node.
    """
    return WithinRun(build_up_length=_BUILD_UP_LENGTH, relative_bounds=_RELATIVE_BOUNDS)
