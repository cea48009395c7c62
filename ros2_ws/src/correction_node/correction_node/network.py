"""The paper's network: three hidden layers of ten, ReLU, one output h (section 4, Figure 11)."""

from __future__ import annotations

import math
from itertools import pairwise

import torch
from torch import Tensor, nn

INPUTS = 3
HIDDEN = (10, 10, 10)


class WeightNetwork(nn.Module):
    """h = f(D_cylinder, D_cable, T), inputs normalised to [-1, 1].

    It starts near h = 1, no correction, whatever the seed.
    """

    def __init__(self, generator: torch.Generator) -> None:
        super().__init__()
        widths = (INPUTS, *HIDDEN, 1)
        # nn.Linear would fill itself from the global generator.
        self.linears = tuple(
            nn.Linear(wide, narrow, dtype=torch.float64, device="meta").to_empty(device="cpu")
            for wide, narrow in pairwise(widths)
        )
        self.layers = nn.ModuleList(self.linears)
        with torch.no_grad():
            for layer in self.linears:
                spread = math.sqrt(2.0 / layer.in_features)
                layer.weight.normal_(0.0, spread, generator=generator)
                layer.bias.normal_(0.0, 0.1, generator=generator)
            self.linears[-1].weight.mul_(0.1)
            self.linears[-1].bias.fill_(1.0)

    def forward(self, inputs: Tensor) -> Tensor:
        """Return h, shape (n,), for normalised inputs, shape (n, 3)."""
        values = inputs
        for layer in self.linears[:-1]:
            values = torch.relu(layer(values))
        h: Tensor = self.linears[-1](values)[:, 0]
        return h
