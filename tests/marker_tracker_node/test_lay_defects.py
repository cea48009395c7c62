"""Defects of a lay without markers: gaps, overlaps and climbing turns, found where they are."""

import numpy as np
import pytest
from known_lay import SMALL, TURN, KnownLay, ramp

from winding_core.lay.records import LayFlag

GAP = 1.0 * 4e-3
SLIDE = 0.6


def shifted(way, at):
    return lambda theta: way * ramp((theta - at) / SLIDE)


def raised(way, at, hold):
    return lambda theta: (
        way * (ramp((theta - at) / SLIDE) - ramp((theta - at - SLIDE - hold) / SLIDE))
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "flag"),
    [
        (shifted(GAP, 1.4 * TURN), LayFlag.GAP),
        (shifted(-0.3 * 4e-3, 1.4 * TURN), LayFlag.OVERLAP),
        (raised(-1.5 * 4e-3, 1.4 * TURN, 2.0), LayFlag.CLIMB),
    ],
)
def test_a_defect_is_found_where_it_is(change, flag):
    lay = KnownLay(0.03, 0.002, 0.00404, turns=4, changes=[change])
    found = [d for d in lay.measured()[0].report().defects if d.flag is flag]
    (meant,) = [d for d in lay.defects() if d.flag is flag and d.last < 3.0 * TURN]
    near = [d for d in found if abs(d.first - meant.first) < 0.1 * TURN]
    assert len(near) == 1
    assert near[0].last == pytest.approx(meant.last, abs=0.1 * TURN)


@pytest.mark.slow
def test_a_climbing_turn_is_told_with_its_height():
    lay = KnownLay(0.03, 0.002, 0.00404, turns=3, changes=[raised(-6e-3, 1.4 * TURN, 2.0)])
    records = lay.measured()[0].records()
    climbing = records[(records["flags"] & LayFlag.CLIMB) > 0]
    top = climbing[np.abs(climbing["theta"] - (1.4 * TURN + SLIDE + 1.0)) < 0.5]
    lifted = np.interp(top["theta"], lay.theta, lay.lift)
    # On the crease between two turns sqrt(3) r; z there is known to 0.1 mm, and with it the height.
    np.testing.assert_allclose(top["lift"], lifted, atol=2e-4)


def random_lay(seed):
    """Return a lay of six turns with one to three defects."""
    dice = np.random.default_rng(seed)
    radius, cable = dice.uniform(0.01, 0.05), dice.uniform(0.001, 0.003)
    d, rho = 2.0 * cable, radius + cable
    pitch = d * (1.02 if dice.random() < 0.5 else dice.uniform(1.1, 3.0))
    while pitch * 6 > 0.09:
        pitch *= 0.8
    pitch = max(pitch, 1.02 * d)
    phase = dice.uniform(0.0, 6.0)
    changes = [lambda theta: 0.02 * d * np.sin(0.7 * theta + phase)]
    at = dice.uniform(1.1, 1.5) * TURN
    while at < 4.4 * TURN:
        kind = dice.choice(["gap", "overlap", "climb"])
        hold = 0.0
        if kind == "gap":
            way = dice.uniform(0.5, 1.5) * d
        elif kind == "overlap":
            way = dice.uniform(0.62, 0.76) * d - pitch
        else:
            way = -(pitch + cable) if pitch < 1.1 * d else -pitch
            hold = dice.uniform(0.2, 0.5) * TURN
        # A cable leaves its way by a quarter of a radian at most.
        slide = max(abs(way) * 1.5 / (0.25 * rho), 0.15)
        changes.append(
            lambda theta, way=way, at=at, slide=slide, hold=hold, back=kind == "climb": (
                way
                * (ramp((theta - at) / slide) - back * ramp((theta - at - slide - hold) / slide))
            )
        )
        at += (2.0 * slide + hold if hold else 0.0) + dice.uniform(1.5, 2.1) * TURN
    return KnownLay(radius, cable, pitch, turns=6, changes=changes)


@pytest.mark.campaign
@pytest.mark.timeout(3600)
def test_defects_of_a_hundred_random_lays():
    hits = missed = wrong = 0
    end = 6 * TURN - 0.8
    for seed in range(1000, 1100):
        lay = random_lay(seed)
        tracker, _ = lay.measured(step=min(0.06, lay.config(SMALL).turning), seed=seed)
        # What lasts less than 0.4 rad may be told or not; so may what has hardly begun.
        meant = [d for d in lay.defects() if TURN - 0.3 < d.first < end - 0.4]
        found = [d for d in tracker.report().defects if TURN - 0.3 < d.first < end - 0.4]

        def same(one, other):
            return (
                one.flag is other.flag
                and abs(one.first - other.first) < 0.1 * TURN
                and abs(min(one.last, end) - min(other.last, end)) < 0.1 * TURN
            )

        for defect in meant:
            if defect.last - defect.first > 0.4:
                hits += any(same(defect, other) for other in found)
                missed += not any(same(defect, other) for other in found)
        wrong += sum(
            d.last - d.first > 0.4 and not any(same(d, other) for other in meant) for d in found
        )
    assert hits / (hits + missed) >= 0.99
    assert hits / (hits + wrong) >= 0.99
