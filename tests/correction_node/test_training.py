from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from correction_node.dataset import condition_inputs, lengths, load_data_set
from correction_node.evaluation import cell_errors_pct
from correction_node.network import WeightNetwork
from correction_node.perceptron import Perceptron
from correction_node.training import TrainingConfig, train

CELLS = load_data_set("paper").cells
SHORT = TrainingConfig(steps=40)


def test_the_network_has_the_papers_shape() -> None:
    network = WeightNetwork(torch.Generator().manual_seed(0))
    shapes = [tuple(layer.weight.shape) for layer in network.linears]
    assert shapes == [(10, 3), (10, 10), (10, 10), (1, 10)]
    # First layer 40, two inner layers 110 each, output 11.
    assert sum(p.numel() for p in network.parameters()) == 271


def test_the_same_seed_gives_the_same_bits() -> None:
    first, second = train(CELLS, SHORT), train(CELLS, SHORT)
    for one, other in zip(first.perceptron.weights, second.perceptron.weights, strict=True):
        assert one.tobytes() == other.tobytes()
    assert first.loss.tobytes() == second.loss.tobytes()


def test_training_leaves_the_callers_random_numbers_alone() -> None:
    torch.manual_seed(3)
    before = torch.get_rng_state()
    train(CELLS, SHORT)
    assert torch.equal(before, torch.get_rng_state())


def test_another_seed_gives_another_network() -> None:
    other = train(CELLS, dataclasses.replace(SHORT, seed=1))
    assert not np.array_equal(other.loss, train(CELLS, SHORT).loss)


def test_the_loss_is_equation_five() -> None:
    trained = train(CELLS, TrainingConfig(steps=1))
    network = WeightNetwork(torch.Generator().manual_seed(0))
    inputs = condition_inputs(CELLS)
    x = Perceptron.normalised(inputs, inputs.min(axis=0), inputs.max(axis=0))
    h = network(torch.from_numpy(x)).detach().numpy()
    s_fem, s_exp = lengths(CELLS)
    # Rounding of one mean in double precision.
    assert trained.loss[0] == pytest.approx(np.mean((h * s_fem - s_exp) ** 2), rel=1e-12)


def test_plain_arrays_predict_what_torch_predicts() -> None:
    network = WeightNetwork(torch.Generator().manual_seed(5))
    rng = np.random.default_rng(0)
    low, high = np.array([0.03, 0.002, 11.0]), np.array([0.06, 0.006, 14.0])
    inputs = rng.uniform(low, high, (20, 3))
    plain = Perceptron(
        weights=tuple(layer.weight.detach().numpy() for layer in network.linears),
        biases=tuple(layer.bias.detach().numpy() for layer in network.linears),
        low=low,
        high=high,
    )
    x = torch.from_numpy(Perceptron.normalised(inputs, low, high))
    # Rounding of four small products in double precision.
    np.testing.assert_allclose(plain.h(inputs), network(x).detach().numpy(), rtol=1e-12)


def test_one_length_per_case_is_learned_to_the_end() -> None:
    cells = [dataclasses.replace(c, s_exp=1.2 * c.s_fem) for c in CELLS if c.marker == 4]
    trained = train(cells, TrainingConfig(steps=300, weight_decay=0.0))
    h = trained.perceptron.h(condition_inputs(cells))
    # 300 steps bring the loss to 1e-6 of the squared lengths and below: h to 1e-3.
    np.testing.assert_allclose(h, 1.2, rtol=2e-3)
    assert cell_errors_pct(cells, h).mean() < 0.2


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"seed": -1}, "seed must not be negative, got -1"),
        ({"steps": 0}, "steps must be at least 1, got 0"),
        ({"learning_rate": 0.0}, "learning_rate must be positive"),
        ({"learning_rate": float("nan")}, "learning_rate must be positive"),
        ({"weight_decay": -1.0}, "weight_decay must not be negative"),
    ],
)
def test_a_wrong_configuration_is_refused(change: dict[str, float], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        TrainingConfig(**change)  # type: ignore[arg-type]
