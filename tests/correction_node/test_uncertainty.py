from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from correction_node.models.dataset import lengths, load_data_set
from correction_node.models.uncertainty import TrainingBox, conformal_bound
from winding_core.cable.cases import Case, paper_case, paper_cases

CELLS = load_data_set("paper").cells
BOX = TrainingBox.around(CELLS)


def test_ninety_percent_of_twelve_cases_is_the_largest_residual() -> None:
    h = np.ones(len(CELLS))
    s_fem, s_exp = lengths(CELLS)
    bound = conformal_bound(CELLS, h, 0.9)
    assert bound.relative == np.abs(s_exp / s_fem - 1.0).max()
    assert bound.level == pytest.approx(12 / 13)


def test_a_level_that_twelve_cases_cannot_carry_is_refused() -> None:
    with pytest.raises(ValueError, match=r"level must lie in \(0, 0.923\] with 12 cases, got 0.95"):
        conformal_bound(CELLS, np.ones(len(CELLS)), 0.95)


@pytest.mark.slow
def test_the_bound_covers_new_cases_as_often_as_it_says() -> None:
    rng = np.random.default_rng(7)
    whole = [c for c in CELLS if c.case not in (2, 7, 8)]
    one = [c for c in whole if c.case == 1]
    covered = 0
    trials = 2000
    for _ in range(trials):
        cells = [
            dataclasses.replace(c, case=n, s_fem=1.0, s_exp=float(1.0 + e))
            for n, spread in enumerate(rng.normal(0.0, 0.05, 12))
            for c, e in zip(one, spread + rng.normal(0.0, 0.01, 4), strict=True)
        ]
        bound = conformal_bound(cells, np.ones(len(cells)), 0.8)
        new = rng.normal(0.0, 0.05) + rng.normal(0.0, 0.01, 4)
        covered += np.abs(new).max() <= bound.relative
    # rank 11 of 12 covers 11/13; four binomial standard errors of 2000 trials.
    share = 11 / 13
    assert covered / trials == pytest.approx(share, abs=4 * math.sqrt(share * (1 - share) / trials))


def test_every_trained_condition_is_inside() -> None:
    assert [BOX.outside(case) for case in paper_cases()] == [None] * 12


def test_a_condition_between_the_trained_ones_is_inside() -> None:
    between = Case(cylinder_diameter=0.045, cable_diameter=0.003, weight=3.0, marker_spacing=0.15)
    assert BOX.outside(between) is None


def test_a_condition_outside_is_named() -> None:
    for name, value in [
        ("cylinder_diameter", 0.029),
        ("cylinder_diameter", 0.080),
        ("cable_diameter", 0.0015),
        ("cable_diameter", 0.008),
        ("weight", 1.5),
        ("weight", 30.0),
    ]:
        outside = BOX.outside(dataclasses.replace(paper_case(4), number=0, **{name: value}))
        assert outside is not None
        assert name in outside
        assert "no correction" in outside
