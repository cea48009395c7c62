"""Which known condition a run resembles, by its measured lengths (K-NN, paper section 4)."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from correction_node.models.dataset import Array
from winding_core.cable.cases import published_markers

MARKERS = 4
NEIGHBOURS = 5
REPETITIONS = 10


class Noise(Enum):
    """What differs between two repetitions of one run.

    RUN: All lengths of a repetition are off by one common share. This is what repeating a run
        means here: the cable is pulled a little harder or less hard, and the whole run is
        longer or shorter.
    MARKER: Each length is off by a share of its own, as if each were measured on its own.
    """

    RUN = "run"
    MARKER = "marker"


@dataclass(frozen=True, kw_only=True)
class Resemblance:
    """The known condition that a run resembles."""

    case: int  # Row of Table 1 with most votes
    share: float  # Its share of the votes
    votes: Mapping[int, float]  # Share of every case that got votes; the shares add up to one


def published_lengths() -> tuple[NDArray[np.int64], Array]:
    """Return (case numbers, shape (12,); measured S_1..S_4 [m], NaN where missing, (12, 4))."""
    rows = published_markers()
    numbers = sorted({row.case for row in rows})
    table = np.full((len(numbers), MARKERS), np.nan)
    for row in rows:
        if row.experiment is not None:
            table[numbers.index(row.case), row.marker - 1] = row.experiment.s
    return np.array(numbers), table


def marker_scatter(table: Array) -> float:
    """Return the relative standard deviation of a single length, by the lengths themselves.

    From the second marker on the cable runs off evenly: S_2 - 2 S_3 + S_4 is the error of four
    lengths, whose variance is six times that of one. What a whole run differs by from another one
    is not in it; the ten repetitions of each experiment were not published.

    Args:
        table: S_1..S_4 [m], shape (n, 4); rows with NaN do not count.
    """
    bent = np.diff(table, n=2, axis=1)[:, -1] / table.mean(axis=1)
    return float(np.sqrt(np.nanmean(bent**2) / 6.0))


def repeated_runs(
    table: Array, repetitions: int, noise: float, kind: Noise, generator: np.random.Generator
) -> Array:
    """Return repeated measurements of each row, shape (rows * repetitions, n), row after row.

    Simulated: normal relative errors of standard deviation `noise`.
    """
    repeated = np.repeat(table, repetitions, axis=0)
    columns = 1 if kind is Noise.RUN else repeated.shape[1]
    return np.asarray(repeated * np.exp(generator.normal(0.0, noise, (len(repeated), columns))))


@dataclass(frozen=True, kw_only=True)
class KnownRuns:
    """Runs of known cases, among which the nearest vote."""

    lengths: Array  # [m], shape (n, 4); NaN where a marker is missing
    cases: NDArray[np.int64]  # Shape (n,)
    neighbours: int  # k

    def votes(self, lengths: Array) -> tuple[NDArray[np.int64], Array]:
        """Return (cases, ascending, shape (c,); share of the votes of each run, shape (m, c)).

        Args:
            lengths: Runs to name [m], shape (m, 4); NaN where a marker is missing.
        """
        off = np.log(lengths)[:, np.newaxis] - np.log(self.lengths)
        with np.errstate(invalid="ignore"):
            # Runs without a common marker are further than any other: NaN is sorted last.
            distance = np.nansum(off**2, axis=2) / np.isfinite(off).sum(axis=2)
        nearest = np.argsort(distance, axis=1, kind="stable")[:, : self.neighbours]
        cases = np.unique(self.cases)
        named = self.cases[nearest][:, :, np.newaxis] == cases
        return cases, named.mean(axis=1)


class Neighbours:
    """K-nearest-neighbour classifier over the logarithms of lengths.

    Equal relative differences are equally far; a length that either side misses is left out
    of the distance, which is then scaled up to the full number of markers.

    Args:
        noise: Relative standard deviation of the simulated repetitions; None: that of the
            published lengths, see `marker_scatter`.
        seed: Of the simulated repetitions.
    """

    def __init__(self, *, noise: float | None = None, seed: int = 0) -> None:
        cases, table = published_lengths()
        noise = marker_scatter(table) if noise is None else noise
        generator = np.random.default_rng(seed)
        repeated = repeated_runs(table, REPETITIONS, noise, Noise.MARKER, generator)
        self._known = KnownRuns(
            lengths=repeated, cases=np.repeat(cases, REPETITIONS), neighbours=NEIGHBOURS
        )

    def classify(self, lengths: ArrayLike) -> Resemblance:
        """Return the condition that measured lengths resemble.

        Args:
            lengths: S_1..S_4 [m], shape (4,) or shorter; NaN where a marker is not measured.

        Raises:
            ValueError: Nothing is measured, a length is not positive, or there are too many.
        """
        run = _padded(lengths)
        cases, (shares,) = self._known.votes(run[np.newaxis])
        votes = {
            int(case): float(share)
            for case, share in zip(cases, shares, strict=True)
            if share > 0.0
        }
        case = max(votes, key=lambda number: votes[number])
        return Resemblance(case=case, share=votes[case], votes=votes)


def _padded(lengths: ArrayLike) -> Array:
    given = np.asarray(lengths, dtype=float)
    if given.ndim != 1 or len(given) > MARKERS:
        raise ValueError(f"lengths must be at most {MARKERS} numbers, got shape {given.shape}")
    known = given[~np.isnan(given)]
    if len(known) == 0:
        raise ValueError("no length is measured yet: nothing to compare")
    if not (np.isfinite(known).all() and (known > 0.0).all()):
        raise ValueError(f"lengths must be positive and finite, got {known.tolist()} m")
    padded = np.full(MARKERS, np.nan)
    padded[: len(given)] = given
    return padded
