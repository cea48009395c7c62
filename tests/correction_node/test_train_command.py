from __future__ import annotations

import pytest
import typer
from typer.testing import CliRunner

from correction_node.weights import load_weight
from winding_bringup.commands.train import train


@pytest.fixture
def command() -> typer.Typer:
    app = typer.Typer()
    app.command()(train)
    return app


def test_training_writes_weights_and_says_how_good_they_are(command, tmp_path) -> None:
    out = tmp_path / "mine"
    done = CliRunner().invoke(
        command, ["--data", "paper", "--steps", "2", "--seed", "5", "--out", str(out)]
    )
    assert done.exit_code == 0, done.output
    assert load_weight(out).card["training"]["seed"] == 5
    for said in ("leave one case out", "network", "ridge", "On cases left out"):
        assert said in done.output


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--data", "nowhere.csv"], "no data set nowhere.csv"),
        (["--data", "paper", "--seed", "-1"], "--seed"),
        (["--data", "paper", "--steps", "0"], "--steps"),
    ],
)
def test_what_cannot_be_trained_is_refused(command, arguments, sentence) -> None:
    refused = CliRunner().invoke(command, arguments)
    assert refused.exit_code == 2
    assert sentence in refused.output


def test_data_of_ones_own_needs_a_folder_of_ones_own(command, tmp_path) -> None:
    from correction_node.dataset import format_lengths, load_data_set

    path = tmp_path / "own.csv"
    path.write_text(format_lengths((c.case, c.marker, c.s_fem) for c in load_data_set("rod").cells))
    refused = CliRunner().invoke(command, ["--data", str(path)])
    assert refused.exit_code == 2
    assert "give --out" in refused.output
