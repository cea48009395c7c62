from __future__ import annotations

import dataclasses
import json
import subprocess
import sys

import numpy as np
import pytest

from correction_node.models.dataset import load_data_set
from correction_node.models.weights import load_factor, save_factor
from correction_node.training.evaluation import BASELINES
from correction_node.training.learners import LEARNERS, RIG, RIG_NETWORK
from correction_node.training.protocol import learn, verdict
from correction_node.training.training import TrainingConfig
from winding_core.cable.cases import paper_case

pytestmark = pytest.mark.slow
DATA = load_data_set("rod")


SHORT = TrainingConfig(steps=30)


@pytest.fixture(scope="module", params=list(LEARNERS))
def learned(request):
    return request.param, learn(DATA, request.param, SHORT, lambda stage: None, seed=3)


def test_model_and_baselines_are_scored_alike(learned) -> None:
    name, result = learned
    assert set(result.scores) == {name, *BASELINES}
    for score in result.scores.values():
        assert score.in_sample.shape == score.held_out.shape == (45,)
        assert np.isfinite([score.in_sample_pct, score.leave_one_case_out_pct]).all()


def test_the_card_says_what_the_weights_come_from(learned) -> None:
    name, result = learned
    card = result.factor.card
    assert card["data"] == {"name": "rod", "sha256": DATA.sha256, "cells": 45, "cases": 12}
    assert card["training"].get("seed") == (3 if LEARNERS[name].seeded else None)
    assert set(card["errors"]) == set(result.scores)
    json.dumps(card, allow_nan=False)


def test_the_card_of_a_form_found_on_these_cells_says_so(learned) -> None:
    name, result = learned
    optimistic = "with all 45 cells in view" in result.factor.card["selection"]
    assert optimistic == (name in (RIG, RIG_NETWORK))


@pytest.mark.slow
def test_a_case_that_is_left_out_is_never_seen(learned) -> None:
    name, result = learned
    cells = [dataclasses.replace(c, s_exp=2.0 * c.s_exp) if c.case == 9 else c for c in DATA.cells]
    changed = learn(dataclasses.replace(DATA, cells=tuple(cells)), name, SHORT, print, seed=3)
    mine = np.array([cell.case == 9 for cell in cells])
    np.testing.assert_array_equal(
        result.scores[name].held_out[mine], changed.scores[name].held_out[mine]
    )
    assert not np.array_equal(result.scores[name].in_sample, changed.scores[name].in_sample)


def test_what_was_learned_can_be_saved_and_used(learned, tmp_path) -> None:
    factor = learned[1].factor
    save_factor(factor, tmp_path)
    assert load_factor(tmp_path).factor(paper_case(2)) == factor.factor(paper_case(2))


def test_the_verdict_names_who_is_best_on_cases_never_seen(learned) -> None:
    name, result = learned
    scores = dict(result.scores)
    scores[name] = dataclasses.replace(scores[name], leave_one_case_out_pct=9.0)
    scores["ridge"] = dataclasses.replace(scores["ridge"], leave_one_case_out_pct=1.0)
    sentence = verdict(name, scores)
    assert f"plain baseline 'ridge' beats the {name}: 1.00 % against 9.00 %" in sentence
    scores[name] = dataclasses.replace(scores[name], leave_one_case_out_pct=0.5)
    assert f"the {name} is best" in verdict(name, scores)


def test_physics_is_not_fitted_to_a_solver_far_from_it() -> None:
    for name in [RIG, RIG_NETWORK]:
        with pytest.raises(ValueError, match=f"model {name} needs lengths of a solver within 1%"):
            learn(load_data_set("paper"), name, SHORT, lambda stage: None)


def test_a_model_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ValueError, match=r"model must be one of network, .* got 'oracle'"):
        learn(DATA, "oracle", SHORT, lambda stage: None)


@pytest.mark.slow
def test_correcting_needs_no_torch() -> None:
    asked = (
        "import sys; from winding_core.cable.cases import paper_case; "
        "from correction_node.live.corrector import Corrector; "
        "from correction_node.models.weights import SHIPPED, load_factor, weights_directory; "
        "[Corrector(load_factor(weights_directory(n))).factor(paper_case(1)) for n in SHIPPED]; "
        "sys.exit('torch' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", asked], check=False).returncode == 0
