"""A whole sweep: what its runs are, which are done, who winds the rest."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from cable_fem_node.winding.prediction import PlannedRun
from winding_study.run_store import Arrays, RunStore
from winding_study.sweep.engines import Engine


@dataclass(frozen=True, kw_only=True)
class Shard:
    """One of several disjoint parts of a sweep."""

    number: int = 1  # Which part, from 1
    count: int = 1  # How many parts there are

    def __post_init__(self) -> None:
        if not 1 <= self.number <= self.count:
            raise ValueError(
                f"shard must be k/N with k from 1 to N, got {self.number}/{self.count}"
            )

    @classmethod
    def parse(cls, text: str) -> Shard:
        """Read k/N.

        Raises:
            ValueError: The text is something else.
        """
        number, _, count = text.partition("/")
        if not (number.isdecimal() and count.isdecimal()):
            raise ValueError(f"shard must be k/N with k from 1 to N, got {text!r}")
        return cls(number=int(number), count=int(count))

    def keys(self, keys: Sequence[str]) -> tuple[str, ...]:
        """Return this part's keys: of the different ones, every count-th in order."""
        return tuple(dict.fromkeys(keys))[self.number - 1 :: self.count]


def stored_results(
    store: RunStore, keys: Sequence[str], say: Callable[[str], None]
) -> dict[str, Arrays]:
    """Return the results of the keys that are in a store.

    Args:
        store: The store.
        keys: Runs to look up.
        say: Called with one sentence for each damaged file.
    """
    found = {key: store.load(key, say) for key in dict.fromkeys(keys)}
    return {key: results for key, results in found.items() if results is not None}


def wind_missing(
    runs: Mapping[str, PlannedRun],
    done: Mapping[str, Arrays],
    *,
    engine: Engine,
    store: RunStore,
    ended: Callable[[Arrays], None],
) -> dict[str, Arrays]:
    """Wind the runs that are not done and return the results of all.

    Args:
        runs: Runs by key.
        done: Results that are there already.
        engine: Who winds.
        store: Where each result is kept as soon as it is there.
        ended: Called in this process with the results of each run.

    Raises:
        EngineError: The engine cannot go on; what is stored stays stored.
        SolverMismatchError: A worker has another solver.
        OSError: The store cannot be written.
    """
    results = dict(done)
    missing = {key: run for key, run in runs.items() if key not in done}
    if missing:
        for key, found in engine.wind(missing, store):
            results[key] = found
            ended(found)
    return results
