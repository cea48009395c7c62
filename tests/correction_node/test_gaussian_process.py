from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from correction_node.models.dataset import load_data_set
from correction_node.training.comparison import NOISE, learn_process

CELLS = load_data_set("rod").cells


def _as_predicted(asked):
    return np.ones(len(asked))


@pytest.fixture(scope="module")
def process():
    return learn_process([cell for cell in CELLS if cell.case != 7], _as_predicted)


def test_known_cells_are_met_within_the_noise(process) -> None:
    known = [cell for cell in CELLS if cell.case != 7]
    h = np.array([cell.s_exp / cell.s_fem for cell in known])
    # Four standard deviations of the assumed noise.
    np.testing.assert_allclose(np.log(process.h(known) / h), 0.0, atol=4 * NOISE)


def test_a_case_far_from_all_others_has_the_wider_interval(process) -> None:
    def width(case: int) -> float:
        low, high = process.bounds([cell for cell in CELLS if cell.case == case], 0.9)
        assert (low < high).all()
        return float(np.mean(high - low))

    assert width(7) > 2.0 * width(9)


def test_a_base_that_is_right_is_left_alone() -> None:
    cells = [dataclasses.replace(c, s_exp=1.1 * c.s_fem) for c in CELLS]
    process = learn_process(cells, lambda asked: np.full(len(asked), 1.1))
    np.testing.assert_allclose(process.h(cells), 1.1, rtol=1e-9)
