"""The estimator on sightings that are drawn from its own model, with one or two wrong numbers."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from marker_tracker_node.tracking.estimator.contradictions import explained
from marker_tracker_node.tracking.estimator.numbers import NUMBERS
from winding_verification.tracker.scenes import World
from winding_verification.tracker.sightings import quick, sightings
from winding_verification.tracker.wrong_numbers import WrongNumber, every_number

# Pairs of wrong numbers of each run.
_PAIRS = 4


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """What the estimator made of a run."""

    seed: int  # Of the run
    wrong: tuple[WrongNumber, ...]  # None, one or two
    named: frozenset[str]  # Numbers of the contradictions, alternatives among them
    cpu: float  # [s]

    @property
    def right(self) -> int:
        """How many of the wrong numbers are named."""
        return sum(bool(one.names & self.named) for one in self.wrong)

    @property
    def innocent(self) -> bool:
        """Whether others are named, and none of the wrong ones."""
        return bool(self.named) and not self.right

    def __str__(self) -> str:
        wrong = " and ".join(f"{one.number} {one.size:+.4g}" for one in self.wrong) or "right"
        return f"{self.seed} {wrong}: {', '.join(sorted(self.named)) or '-'}"


def drawn(seeds: Iterable[int]) -> Iterator[Drawn]:
    """Yield the right configuration, every wrong number and some pairs of each seed."""
    for seed in seeds:
        world, names = quick(World.drawn(seed)), {number.name for number in NUMBERS}
        single = [(one,) for one in every_number(seed) if one.number in names]
        pairs = list(itertools.combinations([one for (one,) in single], 2))
        for wrong in ((), *single, *pairs[seed % 7 :: max(len(pairs) // _PAIRS, 1)]):
            seen = sightings(world, wrong, seed)
            began = time.process_time()
            found = explained(seen)[0]
            yield Drawn(
                seed=seed,
                wrong=wrong,
                named=frozenset().union(*(item.names for item in found)),
                cpu=time.process_time() - began,
            )


def drawn_summary(runs: Iterable[Drawn]) -> str:
    """Return counts."""
    found = list(runs)
    by_count = [[one for one in found if len(one.wrong) == count] for count in range(3)]
    right, single, pairs = by_count
    return "\n".join(
        (
            f"right configurations: {len(right)}, alarms {sum(bool(one.named) for one in right)}",
            f"single: {len(single)}, named {sum(one.right for one in single)}, "
            f"innocent {sum(one.innocent for one in single)}",
            f"pairs: {len(pairs)}, both named {sum(one.right == 2 for one in pairs)}, "
            f"one {sum(one.right == 1 for one in pairs)}, "
            f"innocent {sum(one.innocent for one in pairs)}",
            f"CPU an estimate: {1.0e3 * sum(one.cpu for one in found) / len(found):.1f} ms",
        )
    )
