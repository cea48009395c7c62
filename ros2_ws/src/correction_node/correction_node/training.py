"""Fits the weight h to measured lengths (Eq. 5)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from correction_node.dataset import Array, LengthCell, condition_inputs, lengths
from correction_node.network import WeightNetwork
from correction_node.perceptron import Perceptron


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """How the network is trained.

    Attributes:
        seed: Of the starting weights; nothing else is random.
        steps: Full-batch Adam steps.
        learning_rate: At the start; it falls to zero along a cosine.
        weight_decay: Factor of the sum of squared layer weights, added to the loss.
    """

    seed: int = 0
    steps: int = 1500
    learning_rate: float = 1.0e-2
    weight_decay: float = 1.0e-4

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise ValueError(f"seed must not be negative, got {self.seed}")
        if self.steps < 1:
            raise ValueError(f"steps must be at least 1, got {self.steps}")
        if not (math.isfinite(self.learning_rate) and self.learning_rate > 0.0):
            raise ValueError(f"learning_rate must be positive, got {self.learning_rate}")
        if not (math.isfinite(self.weight_decay) and self.weight_decay >= 0.0):
            raise ValueError(f"weight_decay must not be negative, got {self.weight_decay}")


@dataclass(frozen=True, kw_only=True)
class Training:
    """A fitted network and the way there.

    Attributes:
        perceptron: The fitted network as plain arrays.
        loss: MSE of Eq. 5 before each step [m^2], shape (steps,).
    """

    perceptron: Perceptron
    loss: Array


def train(cells: Sequence[LengthCell], config: TrainingConfig) -> Training:
    """Return the network that minimises MSE(h S_FEM - S_EXP) over the cells.

    Both lengths are divided by the root mean square of S_EXP, one number for all cells: the
    minimum of Eq. 5 stays where it is and the step size has no unit. Double precision on one
    batch: the same cells and configuration give the same bits.
    """
    inputs = condition_inputs(cells)
    s_fem, s_exp = lengths(cells)
    low, high = inputs.min(axis=0), inputs.max(axis=0)
    length = float(np.sqrt(np.mean(s_exp**2)))

    network = WeightNetwork(torch.Generator().manual_seed(config.seed))
    x = torch.from_numpy(Perceptron.normalised(inputs, low, high))
    fem, experiment = torch.from_numpy(s_fem / length), torch.from_numpy(s_exp / length)
    optimiser = torch.optim.Adam(network.parameters(), lr=config.learning_rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, config.steps)
    loss = np.empty(config.steps)
    for step in range(config.steps):
        optimiser.zero_grad()
        misfit = torch.mean((network(x) * fem - experiment) ** 2)
        size = torch.stack([layer.weight.square().sum() for layer in network.linears]).sum()
        torch.autograd.backward(misfit + config.weight_decay * size)
        optimiser.step()
        schedule.step()
        loss[step] = misfit.item() * length**2
    return Training(
        perceptron=Perceptron(
            weights=tuple(layer.weight.detach().numpy().copy() for layer in network.linears),
            biases=tuple(layer.bias.detach().numpy().copy() for layer in network.linears),
            low=low,
            high=high,
        ),
        loss=loss,
    )
