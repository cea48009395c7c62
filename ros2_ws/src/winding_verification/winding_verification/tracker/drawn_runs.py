"""The estimator on sightings that are drawn from its own model, with one or two wrong numbers."""

import itertools
import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from marker_tracker_node import CameraPose
from marker_tracker_node.detection.band import Band, band_centroid, solve_band
from marker_tracker_node.tracking.estimator.contradictions import explained
from marker_tracker_node.tracking.estimator.numbers import NUMBERS
from marker_tracker_node.tracking.estimator.problem import Seen
from winding_verification.tracker.scenes import World, WrongNumber, every_number

_USABLE = 1.08  # Within these azimuths bands are measured [rad]


def sightings(
    world: World, wrong: tuple[WrongNumber, ...], seed: int, *, noise: float = 0.07
) -> Seen:
    """Return what a tracker with wrong numbers sees of a run, outliers and gaps in it.

    Args:
        world: The run.
        wrong: Numbers of the configuration.
        seed: Of noise, outliers and frames without sightings.
        noise: Of a band's centre [px].
    """
    rng = np.random.default_rng(seed)
    config, focal, readings, stamps = world.config(), 1.0, 1.0, (1.0, 0.0)
    for one in wrong:
        config, focal = one.config(config), focal * one.focal
        readings *= one.reading(1.0)
        stamps = (stamps[0] * (one.stamp(1.0) - one.stamp(0.0)), stamps[1] + one.stamp(0.0))
    camera, body, pose = (
        world.pinhole(focal),
        world.config().body,
        CameraPose(position=world.camera.position),
    )
    true, view = world.pinhole().view(pose), camera.view(config.pose)
    pixel = camera.binning / camera.k[0, 0]
    theta, height = world.markers
    mask = rng.normal(0.0, 1.0, 4) * (0.1, 0.05, 0.05, 0.1) * pixel
    rows, motion = [], []
    for t in world.times.tolist():
        stamp = stamps[0] * t + stamps[1]
        angle, reported = world.position(t)[0], readings * world.encoder(stamp)
        motion.append((stamp, reported))
        for n, wound in enumerate(theta.tolist()):
            azimuth = angle - wound
            away = math.remainder(azimuth, 2.0 * math.pi)
            if azimuth < 0.0 or abs(away) > _USABLE or rng.random() < 0.1:
                continue
            slope = config.advance_per_radian
            a, b, area = band_centroid(true, body, Band(azimuth, height[n], slope))
            scatter = noise if rng.random() > 0.02 else 2.0
            a += mask[0] + mask[1] * math.sin(azimuth) + scatter * pixel * rng.normal()
            b += mask[2] + mask[3] * math.sin(azimuth) + scatter * pixel * rng.normal()
            start = Band(azimuth, height[n], slope)
            found, z = solve_band(view, config.body, a / focal, b / focal, start)
            if math.isnan(found):
                continue
            expected = band_centroid(view, config.body, start._replace(azimuth=found, z=z))[2]
            share = area / expected / focal**2
            lap = round(found / (2.0 * math.pi))
            beside = (slope, -math.pi, math.pi, math.inf, math.inf, 0.0)
            rows.append((n, lap, stamp, reported, found - 2.0 * math.pi * lap, z, *beside, share))
    table = np.array(rows)
    area = float(np.log(np.median(table[:, -1]))) + rng.normal(-0.03, 0.015)
    return Seen.of(
        rows=table[:, :-1],
        motion=np.array(motion),
        area=area,
        zeroed=world.rest > 0.0,
        camera=camera,
        used=config.pose,
        nominal=config.pose,
        body=config.body,
    )


def quick(world: World) -> World:
    """Return a run with fewer frames, which cost time here."""
    return replace(world, fps=20.0)


_PAIRS = 4  # Pairs of wrong numbers of each run


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
    def misnamed(self) -> bool:
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
            f"misnamed {sum(one.misnamed for one in single)}",
            f"pairs: {len(pairs)}, both named {sum(one.right == 2 for one in pairs)}, "
            f"one {sum(one.right == 1 for one in pairs)}, "
            f"misnamed {sum(one.misnamed for one in pairs)}",
            f"CPU an estimate: {1.0e3 * sum(one.cpu for one in found) / len(found):.1f} ms",
        )
    )
