"""Whether the corrected lengths of a run are good enough, and whether the correction helped."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from winding_core.cable.cases import length_error_pct
from winding_core.parameters import parameter
from winding_core.units import PLAIN, json_values

# Mean of Table 8: what the paper's correction leaves of its own 45 lengths (4.81 %).
PAPER_LIMIT_PCT = 4.8

EXPERIMENT = "published experiment"
CAMERA = "camera"


@dataclass(frozen=True, kw_only=True)
class ErrorLimit:
    """How far off a corrected length may be."""

    error_limit_pct: float = parameter(
        PAPER_LIMIT_PCT,
        "largest error of a corrected length that counts as good, in percent; the default is the "
        "mean error that the paper's own correction leaves, its Table 8",
        PLAIN,
        1.0e-3,
        1.0e3,
        read_only=False,
    )


@dataclass(frozen=True, kw_only=True)
class MarkerError:
    """Errors of one marker's lengths in percent, Table 7's measure; None where there is none."""

    id: int  # n of Pn.
    predicted: float | None  # Of the prediction.
    corrected: float | None  # Of the corrected length.
    held_out: float | None  # Of the length corrected by a factor that was learned without this case

    @property
    def name(self) -> str:
        """Pn."""
        return f"P{self.id}"


@dataclass(frozen=True, kw_only=True)
class ErrorVerdict:
    """What the errors of a run say."""

    limit_pct: float  # Largest error that counts as good [%].
    against: str  # EXPERIMENT or CAMERA.
    errors: tuple[MarkerError, ...]  # Of every marker.
    asked: int  # Markers that were to be judged.
    ended: bool = True  # Whether the run came to its end; what broke off is never good.

    @property
    def judged(self) -> tuple[MarkerError, ...]:
        """Markers whose corrected length has a measure beside it."""
        return tuple(item for item in self.errors if item.corrected is not None)

    @property
    def whole(self) -> bool:
        """Whether the run came to its end with every marker judged that it was to judge."""
        return self.ended and len(self.judged) >= self.asked

    @property
    def worst(self) -> MarkerError | None:
        """The marker whose corrected length is farthest off; None without any."""
        return _largest(self.errors, "corrected")

    @property
    def worst_held_out(self) -> MarkerError | None:
        """The same by the factor that was learned without this case."""
        return _largest(self.errors, "held_out")

    @property
    def good(self) -> bool | None:
        """Whether no corrected length is off by more than the limit; None where one is not known.

        One that is too far off is enough for the opposite.
        """
        worst = self.worst
        if worst is None:
            return None
        if _known(worst.corrected) > self.limit_pct:
            return False
        return True if self.whole else None

    @property
    def helped(self) -> tuple[MarkerError, ...]:
        """Markers that the correction brought nearer."""
        return tuple(item for item in self.compared if _gain(item) > 0.0)

    @property
    def worse(self) -> tuple[MarkerError, ...]:
        """Markers that the correction took farther away."""
        return tuple(item for item in self.compared if _gain(item) < 0.0)

    @property
    def compared(self) -> tuple[MarkerError, ...]:
        """Markers with an error before and after the correction."""
        return tuple(
            item
            for item in self.errors
            if item.predicted is not None and item.corrected is not None
        )

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        worst = self.worst
        if worst is None:
            return "cannot be judged: no marker has both a corrected and a measured length"
        word = {True: "good", False: "not good", None: "incomplete"}[self.good]
        sentence = (
            f"{word}: largest error {worst.corrected:.2f} %, limit {self.limit_pct:g} %, marker "
            f"{worst.name}"
        )
        if not self.whole:
            sentence += f", {len(self.judged)} of {self.asked} markers judged"
        if self.against == CAMERA:
            sentence += ", against the camera's lengths"
        sentence += f"; the correction helped on {len(self.helped)} of {len(self.compared)}"
        if self.worse:
            sentence += f" and made {_names(self.worse)} worse"
        return sentence

    @property
    def held_out_sentence(self) -> str:
        """What the verdict would be worth without this case; empty where that is not known."""
        held_out = self.worst_held_out
        if held_out is None:
            return ""
        above = ", above the limit" if _known(held_out.held_out) > self.limit_pct else ""
        return (
            "These errors are in-sample; with this case held out of the training the largest is "
            f"{held_out.held_out:.2f} %, marker {held_out.name}{above}"
        )

    def as_json(self) -> dict[str, Any]:
        """Return the verdict as JSON values; null where there is no number."""
        worst, held_out = self.worst, self.worst_held_out
        return {
            **json_values(self, "good", "whole", "sentence", "limit_pct", "against"),
            "held_out_sentence": self.held_out_sentence or None,
            "largest_error_pct": None if worst is None else worst.corrected,
            "marker": None if worst is None else worst.id,
            "largest_error_held_out_pct": None if held_out is None else held_out.held_out,
            "marker_held_out": None if held_out is None else held_out.id,
            **{
                name: [item.id for item in getattr(self, name)]
                for name in ("compared", "helped", "worse")
            },
            "markers": [
                {
                    "id": item.id,
                    "error_fem_pct": item.predicted,
                    "error_corrected_pct": item.corrected,
                    "error_held_out_pct": item.held_out,
                }
                for item in self.errors
            ],
        }


def error_pct(measured: float | None, predicted: float | None) -> float | None:
    """Return Table 7's error of a length [%]; None where one of both [m] is not known."""
    if measured is None or predicted is None:
        return None
    if not (math.isfinite(measured) and math.isfinite(predicted) and predicted > 0.0):
        return None
    return length_error_pct(float(measured), float(predicted))


def _gain(item: MarkerError) -> float:
    return _known(item.predicted) - _known(item.corrected)


def _known(error: float | None) -> float:
    return math.nan if error is None else error


def _largest(errors: Sequence[MarkerError], name: str) -> MarkerError | None:
    known = [item for item in errors if getattr(item, name) is not None]
    return max(known, key=lambda item: float(getattr(item, name)), default=None)


def _names(markers: Sequence[MarkerError]) -> str:
    names = [item.name for item in markers]
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
