"""The estimator's verdict in words."""

from __future__ import annotations

import math

from marker_tracker_node.tracking.checks.contradiction import Contradiction
from marker_tracker_node.tracking.estimator.numbers import NUMBERS
from marker_tracker_node.tracking.estimator.problem import Problem, Seen
from marker_tracker_node.tracking.estimator.verdict import Explanation, judged


def contradictions(seen: Seen) -> tuple[Contradiction, ...]:
    """Return which configured numbers the sightings contradict; empty for a consistent run."""
    if not len(seen.rows) or seen.rows[:, 0].min() > 0:
        return ()
    verdict = judged(Problem(seen))
    return tuple(_contradiction(group, verdict.explained) for group in verdict.wrong)


def _contradiction(group: tuple[Explanation, ...], explained: bool) -> Contradiction:
    best, *others = group
    number = NUMBERS[best.number]
    known = (best.error, best.sigma) if number.relative and explained else (math.nan, math.nan)
    words = [NUMBERS[one.number].sentence(one.error) for one in group]
    sentence = ", or ".join(words)
    if not explained:
        sentence = f"no single number explains the bands; together with others {', '.join(words)}"
    return Contradiction(
        number=number.name,
        share=known[0],
        sigma=known[1],
        sentence=sentence,
        alternatives=tuple(NUMBERS[one.number].name for one in others),
    )
