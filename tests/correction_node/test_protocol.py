from __future__ import annotations

import dataclasses
import json
import subprocess
import sys

import numpy as np
import pytest

from cable_winding.cases import paper_case
from correction_node.baselines import BASELINES
from correction_node.dataset import load_data_set
from correction_node.protocol import NETWORK, learn, verdict
from correction_node.training import TrainingConfig
from correction_node.weights import load_weight, save_weight

DATA = load_data_set("rod")


@pytest.fixture(scope="module")
def learned():
    said: list[str] = []
    result = learn(DATA, TrainingConfig(steps=30, seed=3), said.append)
    return result, said


def test_every_training_is_reported(learned) -> None:
    _, said = learned
    assert len(said) == 1 + 12


def test_network_and_baselines_are_scored_alike(learned) -> None:
    result, _ = learned
    assert set(result.scores) == {NETWORK, *BASELINES}
    for score in result.scores.values():
        assert score.in_sample.shape == score.held_out.shape == (45,)
        assert np.isfinite([score.in_sample_pct, score.leave_one_case_out_pct]).all()


def test_the_card_says_what_the_weights_come_from(learned) -> None:
    card = learned[0].weight.card
    assert card["data"] == {"name": "rod", "sha256": DATA.sha256, "cells": 45, "cases": 12}
    assert card["training"]["seed"] == 3
    assert set(card["errors"]) == set(learned[0].scores)
    assert len(card["normalisation"]["low"]) == 3
    json.dumps(card, allow_nan=False)


def test_what_was_learned_can_be_saved_and_used(learned, tmp_path) -> None:
    weight = learned[0].weight
    save_weight(weight, tmp_path)
    assert load_weight(tmp_path).factor(paper_case(2)) == weight.factor(paper_case(2))


def test_the_verdict_names_who_is_best_on_cases_never_seen(learned) -> None:
    scores = dict(learned[0].scores)
    scores[NETWORK] = dataclasses.replace(scores[NETWORK], leave_one_case_out_pct=9.0)
    scores["ridge"] = dataclasses.replace(scores["ridge"], leave_one_case_out_pct=1.0)
    assert "plain baseline 'ridge' beats the network: 1.00 % against 9.00 %" in verdict(scores)
    scores[NETWORK] = dataclasses.replace(scores[NETWORK], leave_one_case_out_pct=0.5)
    assert "the network is best" in verdict(scores)


def test_correcting_needs_no_torch() -> None:
    asked = "import sys, correction_node.corrector; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", asked], check=False).returncode == 0
