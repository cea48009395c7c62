"""How far two streams of messages of one topic are apart, field by field."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from winding_recorder.bags.reading import Decoder
from winding_recorder.bags.tables import Row, rows_of


@dataclass(kw_only=True)
class Comparison:
    """Answers of a replay beside the recorded ones, for one topic.

    Attributes:
        topic: Full topic name.
        compared: Messages with the same stamp on both sides.
        identical: Those whose bytes are the same.
        missing: Recorded, but not given by the replay.
        extra: Given by the replay, but not recorded.
        differences: Largest absolute difference by numeric field, in the field's unit.
        excess: Largest difference over what the tolerance allows, by field; above 1 is too much.
        mismatches: Fields of text, or numbers of rows, that differ, with how often.
    """

    topic: str
    compared: int = 0
    identical: int = 0
    missing: int = 0
    extra: int = 0
    differences: dict[str, float] = field(default_factory=dict)
    excess: dict[str, float] = field(default_factory=dict)
    mismatches: dict[str, int] = field(default_factory=lambda: defaultdict(int))

    @property
    def agrees(self) -> bool:
        """Whether everything recorded came again, within the tolerance."""
        return not (
            self.missing
            or self.extra
            or self.mismatches
            or any(not excess <= 1.0 for excess in self.excess.values())
        )


Stream = Mapping[int, Sequence[bytes]]


def compare(
    topic: str, type_name: str, recorded: Stream, replayed: Stream, *, tolerance: float
) -> Comparison:
    """Compare messages of the same stamps.

    Args:
        topic: Full topic name.
        type_name: Of both streams.
        recorded: Stamp [ns] -> serialised messages, in order.
        replayed: The same of the replay.
        tolerance: Allowed difference, relative to the recorded value or to 1 if that is larger.
    """
    result = Comparison(topic=topic)
    decoder = Decoder()
    for stamp in sorted(recorded.keys() | replayed.keys()):
        before, after = recorded.get(stamp, ()), replayed.get(stamp, ())
        result.missing += max(0, len(before) - len(after))
        result.extra += max(0, len(after) - len(before))
        for one, other in zip(before, after, strict=False):
            result.compared += 1
            if one == other:
                result.identical += 1
            else:
                _compare_rows(
                    rows_of(stamp, decoder.decode(type_name, one)),
                    rows_of(stamp, decoder.decode(type_name, other)),
                    tolerance,
                    result,
                )
    return result


def _compare_rows(one: list[Row], other: list[Row], tolerance: float, result: Comparison) -> None:
    if len(one) != len(other):
        result.mismatches["rows"] += 1
        return
    for before, after in zip(one, other, strict=True):
        for name in before.keys() | after.keys():
            _compare_values(name, before.get(name), after.get(name), tolerance, result)


def _compare_values(
    name: str, before: object, after: object, tolerance: float, result: Comparison
) -> None:
    if not (isinstance(before, int | float) and isinstance(after, int | float)):
        if before != after:
            result.mismatches[name] += 1
        return
    if math.isnan(before) and math.isnan(after):
        return
    difference = abs(after - before)
    excess = difference / (tolerance * max(1.0, abs(before))) if difference else 0.0
    result.differences[name] = _worse(result.differences.get(name, 0.0), difference)
    result.excess[name] = _worse(result.excess.get(name, 0.0), excess)


def _worse(one: float, other: float) -> float:
    # NaN on one side only is the worst of all, and stays.
    return one if math.isnan(one) or one >= other else other
