from __future__ import annotations

import sys

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from correction_node.models.weights import SHIPPED, load_factor, weights_directory
from correction_node.training.comparison import ONE_H_PER_CASE
from correction_node.training.evaluation import BASELINES
from correction_node.training.learners import LEARNERS
from winding_cli.commands.train import train
from winding_core.cable.cases import paper_cases


@pytest.fixture
def command() -> typer.Typer:
    app = typer.Typer()
    app.command()(train)
    return app


def test_training_writes_weights_and_says_how_good_they_are(command, tmp_path) -> None:
    out = tmp_path / "mine"
    done = CliRunner().invoke(
        command,
        f"--model network --data paper --steps 2 --seed 5 --output {out}".split(),
    )
    assert done.exit_code == 0, done.output
    assert load_factor(out).card["training"]["seed"] == 5
    for text in ("leave one case out", "network", "ridge", "On cases left out"):
        assert text in done.output


@pytest.mark.slow
def test_comparing_prints_every_model_and_writes_nothing(command, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(command, ["--compare", "--steps", "2", "--output", "mine"])
    assert done.exit_code == 0, done.output
    for name in (*LEARNERS, *BASELINES, ONE_H_PER_CASE):
        assert name in done.output
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rod_rig", "rod_marker_network"])
def test_a_shipped_weight_comes_out_of_its_model_again(command, tmp_path, name) -> None:
    data, model = SHIPPED[name]
    done = CliRunner().invoke(
        command, ["--data", data, "--model", model, "--output", str(tmp_path)]
    )
    assert done.exit_code == 0, done.output
    shipped, again = load_factor(weights_directory(name)), load_factor(tmp_path)
    for case in paper_cases():
        # Bits are equal on one machine; another processor may round sums in another order.
        np.testing.assert_allclose(
            again.factor(case).by_marker, shipped.factor(case).by_marker, rtol=2e-3
        )


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--data", "nowhere.csv"], "no data set nowhere.csv"),
        (["--model", "oracle", "--output", "x"], "--model must be one of rig network, rig"),
        (["--model", "rig", "--data", "paper", "--output", "x"], "model rig needs lengths"),
        (["--model", "rig", "--data", "paper"], "give --output"),
        (["--data", "paper", "--seed", "-1"], "--seed"),
        (["--data", "paper", "--steps", "0"], "--steps"),
    ],
)
def test_what_cannot_be_trained_is_refused(command, arguments, sentence) -> None:
    refused = CliRunner().invoke(command, arguments)
    assert refused.exit_code == 2
    assert sentence in refused.output


def test_data_of_ones_own_needs_a_folder_of_ones_own(command, tmp_path) -> None:
    from correction_node.models.dataset import format_lengths, load_data_set

    path = tmp_path / "own.csv"
    path.write_text(format_lengths((c.case, c.marker, c.s_fem) for c in load_data_set("rod").cells))
    refused = CliRunner().invoke(command, ["--data", str(path)])
    assert refused.exit_code == 2
    assert "give --output" in refused.output


@pytest.mark.parametrize("name", ["torch", "sklearn"])
def test_training_without_its_libraries_says_what_to_install(command, monkeypatch, name) -> None:
    monkeypatch.setitem(sys.modules, name, None)
    refused = CliRunner().invoke(command, [])
    assert refused.exit_code == 2
    assert (
        f"training models needs {name}: pip install 'cable-winding-twin[train]'" in refused.output
    )
