"""The paper's network: three hidden layers of ten, ReLU, one output h (section 4, Figure 11)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn

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
