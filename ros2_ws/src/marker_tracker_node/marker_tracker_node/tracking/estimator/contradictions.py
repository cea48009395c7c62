"""The estimator's verdict: configured numbers that the pictures speak against, in words."""

from __future__ import annotations

import math
from dataclasses import dataclass

from marker_tracker_node.tracking.estimator.correction import Correction, correction
from marker_tracker_node.tracking.estimator.numbers import NUMBERS
from marker_tracker_node.tracking.estimator.problem import MARKER, Problem, Seen
from marker_tracker_node.tracking.estimator.verdict import Explanation, judged


@dataclass(frozen=True, kw_only=True)
class Contradiction:
    """A configured number that the pictures speak against.

    Attributes:
        share: By how much it is set too large, relative; nan where that is not known.
        doubted: Whether the error is within what is doubted of the number: then it is corrected.
    """

    number: str  # Its name: one of `numbers`, marker_spacing, marker_colour or light
    sentence: str  # In words
    share: float = math.nan
    sigma: float = math.nan  # Standard error of the share; nan where it is not known
    alternatives: tuple[str, ...] = ()  # Names of the numbers that explain the pictures as well
    doubted: bool = False

    @property
    def names(self) -> frozenset[str]:
        """The number and its alternatives."""
        return frozenset({self.number, *self.alternatives})


def explained(seen: Seen) -> tuple[tuple[Contradiction, ...], Correction | None]:
    """Return which configured numbers the sightings contradict, and what they correct.

    A consistent run has neither.
    """
    if not (seen.rows[:, MARKER] == 0).any():
        return (), None
    problem = Problem(seen, any_light=True)
    verdict = judged(problem)
    found = tuple(_contradiction(group, verdict.explained) for group in verdict.wrong)
    return found, correction(problem, verdict, made=bool(seen.without.any()))


def _contradiction(group: tuple[Explanation, ...], explained: bool) -> Contradiction:
    best = group[0]
    names = [NUMBERS[one.number].name for one in group]
    sentence = ", or ".join(NUMBERS[one.number].sentence(one.error) for one in group)
    relative = not NUMBERS[best.number].unit and explained
    return Contradiction(
        number=names[0],
        sentence=sentence if explained else f"no number explains the bands alone: {sentence}",
        share=best.error if relative else math.nan,
        sigma=best.sigma if relative else math.nan,
        alternatives=tuple(names[1:]),
        doubted=best.doubted,
    )
