"""The fitted network as plain arrays, so that a node predicts without loading torch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from correction_node.models.dataset import Array


@dataclass(frozen=True, kw_only=True)
class Perceptron:
    """Layers with ReLU between them.

    Attributes:
        weights: Of each layer, shape (outputs, inputs).
        biases: Of each layer, shape (outputs,).
        low: Smallest training inputs, shape (k,); normalised to -1.
        high: Largest training inputs, shape (k,); normalised to +1.
    """

    weights: tuple[Array, ...]
    biases: tuple[Array, ...]
    low: Array
    high: Array

    def h(self, inputs: Array) -> Array:
        """Return h, shape (n,), for inputs of shape (n, k).

        An input beyond the trained range counts as its edge.
        """
        values = np.clip(self.normalised(inputs, self.low, self.high), -1.0, 1.0)
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            values = np.maximum(values @ weight.T + bias, 0.0)
        return np.asarray(values @ self.weights[-1].T + self.biases[-1])[:, 0]

    @staticmethod
    def normalised(inputs: Array, low: Array, high: Array) -> Array:
        """Return inputs mapped from [low, high] to [-1, 1]; a constant input becomes -1."""
        span = np.where(high > low, high - low, 1.0)
        return 2.0 * (inputs - low) / span - 1.0
