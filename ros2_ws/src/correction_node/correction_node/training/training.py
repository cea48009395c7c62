"""Fits networks for the correction factor h to measured lengths (Eq. 5)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor, nn

from correction_node.models.dataset import Array
from correction_node.models.factor_models import Perceptron

HIDDEN = (10, 10, 10)


class FactorNetworks(nn.Module):
    """Networks h = f(inputs) side by side, one for each seed; inputs normalised to [-1, 1].

    They share nothing but their shape: the gradient of the sum of their losses is each one's own.
    Every network starts near h = 1, no correction, whatever its seed.

    Args:
        inputs: Numbers that each network sees.
        seeds: One for each network.
    """

    def __init__(self, inputs: int, seeds: Sequence[int]) -> None:
        super().__init__()
        single = [_start(inputs, seed) for seed in seeds]
        self.weights = nn.ParameterList(
            torch.stack([layers[n][0] for layers in single]) for n in range(len(HIDDEN) + 1)
        )
        self.biases = nn.ParameterList(
            torch.stack([layers[n][1] for layers in single]) for n in range(len(HIDDEN) + 1)
        )

    def forward(self, inputs: Tensor) -> Tensor:
        """Return h, shape (networks, n), for normalised inputs, shape (networks, n, inputs)."""
        values = inputs
        last = len(HIDDEN)
        for n, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            values = torch.baddbmm(bias[:, None, :], values, weight.transpose(1, 2))
            if n < last:
                values = torch.relu(values)
        return values[:, :, 0]

    def size(self) -> Tensor:
        """Return the sum of the squared layer weights of each network, shape (networks,)."""
        return torch.stack([weight.square().sum(dim=(1, 2)) for weight in self.weights]).sum(dim=0)


def _start(inputs: int, seed: int) -> list[tuple[Tensor, Tensor]]:
    generator = torch.Generator().manual_seed(seed)
    layers = []
    for wide, narrow in pairwise((inputs, *HIDDEN, 1)):
        weight = torch.empty((narrow, wide), dtype=torch.float64)
        bias = torch.empty(narrow, dtype=torch.float64)
        weight.normal_(0.0, math.sqrt(2.0 / wide), generator=generator)
        bias.normal_(0.0, 0.1, generator=generator)
        layers.append((weight, bias))
    layers[-1][0].mul_(0.1)
    layers[-1][1].fill_(1.0)
    return layers


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """How the network is trained."""

    steps: int = 1500  # Full-batch Adam steps
    learning_rate: float = 1.0e-2  # At the start; it falls to zero along a cosine
    weight_decay: float = 1.0e-4  # Factor of the sum of squared layer weights, added to the loss

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise ValueError(f"steps must be at least 1, got {self.steps}")
        if not (math.isfinite(self.learning_rate) and self.learning_rate > 0.0):
            raise ValueError(f"learning_rate must be positive, got {self.learning_rate}")
        if not (math.isfinite(self.weight_decay) and self.weight_decay >= 0.0):
            raise ValueError(f"weight_decay must not be negative, got {self.weight_decay}")


@dataclass(frozen=True, kw_only=True)
class Problem:
    """What a network is asked to fit: mean (gain h(inputs) - target)^2 as small as possible."""

    inputs: Array  # Shape (n, k)
    gain: Array  # Factor of h in each row, shape (n,)
    target: Array  # Shape (n,)


@contextmanager
def _one_thread() -> Iterator[None]:
    # Waking a second thread costs more than products of ten by ten numbers.
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


@_one_thread()
def train(
    problems: Sequence[Problem], config: TrainingConfig, seeds: Sequence[int]
) -> tuple[Perceptron, ...]:
    """Return one fitted network for each problem, all trained side by side.

    Double precision, full batch, no randomness but the start: the same arguments give the
    same bits. Problems do not influence each other, rounding aside.

    Args:
        problems: With equally many inputs each.
        config: Of every training.
        seeds: Of each problem's starting weights.

    Raises:
        ValueError: A seed is negative, or there are not as many seeds as problems.
    """
    if len(seeds) != len(problems):
        raise ValueError(f"{len(problems)} problems need as many seeds, got {len(seeds)}")
    if min(seeds) < 0:
        raise ValueError(f"seed must not be negative, got {min(seeds)}")
    longest = max(len(problem.gain) for problem in problems)
    low = [problem.inputs.min(axis=0) for problem in problems]
    high = [problem.inputs.max(axis=0) for problem in problems]
    scaled = [
        Perceptron.normalised(problem.inputs, lowest, highest)
        for problem, lowest, highest in zip(problems, low, high, strict=True)
    ]
    x = _stacked(scaled, longest)
    gain = _stacked([problem.gain for problem in problems], longest)
    target = _stacked([problem.target for problem in problems], longest)
    count = torch.tensor([len(problem.gain) for problem in problems], dtype=torch.float64)

    networks = FactorNetworks(x.shape[2], seeds)
    optimiser = torch.optim.Adam(networks.parameters(), lr=config.learning_rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, config.steps)
    for _ in range(config.steps):
        optimiser.zero_grad()
        misfit = (networks(x) * gain - target).square().sum(dim=1) / count
        torch.autograd.backward((misfit + config.weight_decay * networks.size()).sum())
        optimiser.step()
        schedule.step()
    return tuple(
        Perceptron(
            weights=tuple(weight.detach().numpy()[n].copy() for weight in networks.weights),
            biases=tuple(bias.detach().numpy()[n].copy() for bias in networks.biases),
            low=low[n],
            high=high[n],
        )
        for n in range(len(problems))
    )


def _stacked(rows: Sequence[Array], longest: int) -> torch.Tensor:
    # A padded row has gain and target zero: it adds nothing to the loss.
    stacked = np.zeros((len(rows), longest, *rows[0].shape[1:]))
    for n, row in enumerate(rows):
        stacked[n, : len(row)] = row
    return torch.from_numpy(stacked)
