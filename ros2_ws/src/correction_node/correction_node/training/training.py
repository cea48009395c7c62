"""Fits the correction factor h to measured lengths (Eq. 5)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import torch

from correction_node.models.dataset import Array
from correction_node.models.perceptron import Perceptron
from correction_node.training.network import FactorNetworks


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """How the network is trained.

    Attributes:
        steps: Full-batch Adam steps.
        learning_rate: At the start; it falls to zero along a cosine.
        weight_decay: Factor of the sum of squared layer weights, added to the loss.
    """

    steps: int = 1500
    learning_rate: float = 1.0e-2
    weight_decay: float = 1.0e-4

    def __post_init__(self) -> None:
        if self.steps < 1:
            raise ValueError(f"steps must be at least 1, got {self.steps}")
        if not (math.isfinite(self.learning_rate) and self.learning_rate > 0.0):
            raise ValueError(f"learning_rate must be positive, got {self.learning_rate}")
        if not (math.isfinite(self.weight_decay) and self.weight_decay >= 0.0):
            raise ValueError(f"weight_decay must not be negative, got {self.weight_decay}")


@dataclass(frozen=True, kw_only=True)
class Problem:
    """What a network is asked to fit: mean (gain h(inputs) - target)^2 as small as possible.

    Attributes:
        inputs: Shape (n, k).
        gain: Factor of h in each row, shape (n,).
        target: Shape (n,).
    """

    inputs: Array
    gain: Array
    target: Array


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
