"""The tracker on filmed runs with one wrong number each: what is named, what is published."""

import math
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from marker_tracker_node import Tracker
from marker_tracker_node.tracking.camera_clock import ClockSettings
from marker_tracker_node.tracking.encoder_history import EncoderHistory
from marker_tracker_node.tracking.synchronised_tracker import SynchronisedTracker
from winding_core.machine.readings import AxisReading
from winding_core.markers import MarkerFlag, Markers
from winding_verification.tracker.scenes import RIGHT, World, WrongNumber, every_number

ByteArray = NDArray[np.uint8]

# A published value so many deviations from the truth is wrong.
_FAR = 5.0
_RATE = 200.0


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a run with a wrong number came to."""

    seed: int  # Of the run
    wrong: WrongNumber  # That was configured
    named: tuple[str, ...]  # Numbers of the contradictions, alternatives among them
    sentences: tuple[str, ...]  # Everything that is reported
    healthy: bool  # As reported
    refused: int  # Frames that were not used
    known: int  # Markers
    far: float  # Largest deviation of a run mean from the truth, in its sigma
    strayed: float  # The same of what was published in any frame while the report was healthy
    cpu: float  # [s]

    @property
    def right(self) -> bool:
        """Whether the wrong number is named; for none, whether nothing is."""
        if not self.wrong.number:
            return not self.named and self.healthy
        spoken = any(words in text for words in self.wrong.words for text in self.sentences)
        return spoken or bool(self.wrong.names & set(self.named))

    @property
    def corrected(self) -> bool:
        """Whether nothing is named, and nothing published is wrong."""
        return not self.named and self.known > 1 and self.far < _FAR

    @property
    def kind(self) -> str:
        """In a word."""
        if self.right:
            return "named"
        if self.named:
            return "misnamed"
        return "harmless" if self.corrected else ("silent" if self.healthy else "unhealthy")

    def __str__(self) -> str:
        wrong = f"{self.wrong.number} {self.wrong.size:+.4g}" if self.wrong.number else "right"
        texts = "".join(f"\n    {text}" for text in self.sentences)
        return (
            f"{self.seed} {wrong}: {self.kind}, {', '.join(self.named) or '-'}, "
            f"known {self.known}, worst {self.far:.1f} sigma, {self.strayed:.1f} while healthy, "
            f"refused {self.refused}{texts}"
        )


def outcome(world: World, frames: list[ByteArray], seed: int, wrong: WrongNumber) -> Outcome:
    """Return what the tracker makes of a film with a wrong number."""
    tracker = Tracker(wrong.config(world.config()), world.pinhole(wrong.focal))
    live = SynchronisedTracker(ClockSettings(), EncoderHistory(longest_gap=math.inf, complete=True))
    live.start(tracker)
    sampled = iter(np.arange(0.0, world.duration * 1.1 + 0.6, 1.0 / _RATE).tolist())
    began, strayed = time.process_time(), 0.0
    for true, frame in zip(world.times.tolist(), frames, strict=True):
        stamp = wrong.stamp(true)
        for t in sampled:
            angle, guide = wrong.reading(world.encoder(t)), wrong.guide(world.position(t)[1])
            live.add_reading(t, AxisReading.of_positions(angle, guide))
            if t > stamp + 0.3:
                break
        live.add_frame(stamp, frame)
        for _, records in live.measured(final=True):
            report = live.report()
            if report is not None and report.healthy:
                strayed = max(strayed, _deviation(world, records))
    report = live.report()
    assert report is not None
    spent = time.process_time() - began
    named = [name for item in report.contradictions for name in (item.number, *item.alternatives)]
    return Outcome(
        seed=seed,
        wrong=wrong,
        named=tuple(named),
        sentences=tuple(
            filter(
                None,
                (
                    *(item.sentence for item in report.contradictions),
                    report.clock_doubt,
                    *report.remarks,
                    *report.doubts,
                    report.colour_refusal,
                ),
            )
        ),
        healthy=report.healthy,
        refused=sum(report.rejected.values()),
        known=report.known,
        far=_deviation(world, tracker.estimates()),
        strayed=strayed,
        cpu=spent,
    )


def _deviation(world: World, records: Markers) -> float:
    """Return the largest deviation of records from the truth, in their sigma."""
    if not len(records):
        return 0.0
    valid = (records["flags"] & int(MarkerFlag.NOT_WOUND)) == 0
    valid[0] = False
    theta, z = world.markers
    off = [
        (records["theta"] - theta) / records["sigma_theta"],
        (records["z"] - z) / records["sigma_z"],
    ]
    return float(np.abs(off)[:, valid].max(initial=0.0))


def filmed(seeds: Iterable[int]) -> Iterator[Outcome]:
    """Yield the outcome of the right configuration, and of every wrong number, of each seed."""
    for seed in seeds:
        world = World.drawn(seed)
        frames = world.frames(seed)
        for wrong in (RIGHT, *every_number(seed)):
            if wrong.landing():
                moved = replace(world, landing=wrong.landing())
                yield outcome(moved, moved.frames(seed), seed, wrong)
            else:
                yield outcome(world, frames, seed, wrong)


def summary(outcomes: Iterable[Outcome]) -> str:
    """Return counts by what came of it."""
    found = list(outcomes)
    wrong = [one for one in found if one.wrong.number]
    right = [one for one in found if not one.wrong.number]
    kinds = Counter(one.kind for one in wrong)
    lines = [
        f"right configurations: {len(right)}, without alarm {sum(one.right for one in right)}",
        f"wrong numbers: {len(wrong)}, " + ", ".join(f"{k} {n}" for k, n in kinds.most_common()),
        "published more than 5 deviations from the truth while healthy: "
        f"{sum(one.strayed > _FAR for one in found)}",
        f"frames refused with right stamps: {sum(one.refused for one in found)}",
        f"CPU a run: {np.mean([one.cpu for one in found]):.2f} s",
    ]
    for number in dict.fromkeys(one.wrong.number for one in wrong):
        own = Counter(one.kind for one in wrong if one.wrong.number == number)
        lines.append(f"  {number}: " + ", ".join(f"{k} {n}" for k, n in own.most_common()))
    return "\n".join(lines)
