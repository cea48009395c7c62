"""The trained weight on disk: numbers as safetensors, everything about them in card.json."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load as load_tensors
from safetensors.numpy import save as save_tensors

from cable_winding.cases import Case
from correction_node.dataset import case_inputs
from correction_node.perceptron import Perceptron
from correction_node.uncertainty import Bound, TrainingBox

SCHEMA = "cable-winding-twin/correction-weight/1"
WEIGHTS_FILE = "weights.safetensors"
CARD_FILE = "card.json"
SHIPPED = ("rod", "paper")
LAYERS = 4


@dataclass(frozen=True, kw_only=True)
class Factor:
    """What multiplies the predicted lengths of one condition.

    Attributes:
        h: The weight; 1 outside the trained conditions.
        relative_bound: Half-width of the interval around h S_FEM, as a share of it.
        outside: Why the condition is outside the trained ones, or None.
    """

    h: float
    relative_bound: float
    outside: str | None


@dataclass(frozen=True, kw_only=True)
class TrainedWeight:
    """A fitted h with its reach and its uncertainty.

    Attributes:
        perceptron: The network.
        box: Conditions that it was trained on.
        bound: Interval inside the box.
        outside_bound: Relative half-width outside the box, where nothing is promised.
        card: What the numbers come from and how good they are; JSON values only.
    """

    perceptron: Perceptron
    box: TrainingBox
    bound: Bound
    outside_bound: float
    card: dict[str, Any]

    def factor(self, case: Case) -> Factor:
        """Return the factor for a condition."""
        outside = self.box.outside(case)
        if outside is not None:
            return Factor(h=1.0, relative_bound=self.outside_bound, outside=outside)
        h = float(self.perceptron.h(case_inputs(case)[np.newaxis])[0])
        return Factor(h=h, relative_bound=self.bound.relative, outside=None)


def weights_directory(name: str) -> Path:
    """Return the folder of shipped weights (``rod``, ``paper``), or a path of one's own."""
    if name in SHIPPED:
        return Path(str(files("correction_node").joinpath("models", name)))
    return Path(name)


def save_weight(weight: TrainedWeight, directory: Path) -> None:
    """Write weights and card into a folder, which is made when missing."""
    perceptron = weight.perceptron
    tensors = {"low": perceptron.low, "high": perceptron.high}
    for index, (matrix, bias) in enumerate(
        zip(perceptron.weights, perceptron.biases, strict=True), start=1
    ):
        tensors[f"layer{index}.weight"] = matrix
        tensors[f"layer{index}.bias"] = bias
    content = save_tensors(tensors, metadata={"schema": SCHEMA})
    card = {
        "schema": SCHEMA,
        **weight.card,
        "weights_sha256": hashlib.sha256(content).hexdigest(),
        "box": asdict(weight.box),
        "bound": asdict(weight.bound),
        "outside_bound": weight.outside_bound,
    }
    directory.mkdir(parents=True, exist_ok=True)
    (directory / WEIGHTS_FILE).write_bytes(content)
    (directory / CARD_FILE).write_text(
        json.dumps(card, indent=2, allow_nan=False) + "\n", encoding="utf-8"
    )


def load_weight(directory: Path) -> TrainedWeight:
    """Return the weight that `save_weight` wrote.

    Raises:
        FileNotFoundError: There are no trained weights in the folder.
        ValueError: The files are not trained weights, do not belong together, or are damaged.
    """
    weights_file, card_file = directory / WEIGHTS_FILE, directory / CARD_FILE
    if not (weights_file.is_file() and card_file.is_file()):
        raise FileNotFoundError(f"no trained weights at {directory}: run `winding train`")
    content = weights_file.read_bytes()
    try:
        card = json.loads(card_file.read_text(encoding="utf-8"))
        foreign = card["schema"] != SCHEMA
        digest = card["weights_sha256"]
        box = TrainingBox(**{name: tuple(ends) for name, ends in card["box"].items()})
        bound = Bound(**card["bound"])
        outside_bound = float(card["outside_bound"])
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise ValueError(f"{card_file} is not a card of trained weights: {error!r}") from error
    if foreign:
        raise ValueError(f"{card_file} has schema {card['schema']!r}, expected {SCHEMA!r}")
    if hashlib.sha256(content).hexdigest() != digest:
        raise ValueError(f"{weights_file} does not match its card: run `winding train`")
    return TrainedWeight(
        perceptron=_perceptron(content, weights_file),
        box=box,
        bound=bound,
        outside_bound=outside_bound,
        card=card,
    )


def _perceptron(content: bytes, source: Path) -> Perceptron:
    try:
        tensors = load_tensors(content)
        perceptron = Perceptron(
            weights=tuple(tensors[f"layer{n}.weight"] for n in range(1, LAYERS + 1)),
            biases=tuple(tensors[f"layer{n}.bias"] for n in range(1, LAYERS + 1)),
            low=tensors["low"],
            high=tensors["high"],
        )
        perceptron.h(perceptron.low[np.newaxis])
    except (SafetensorError, KeyError, ValueError, IndexError) as error:
        raise ValueError(f"{source} does not hold the trained network: {error!r}") from error
    if not all(np.isfinite(values).all() for values in tensors.values()):
        raise ValueError(f"{source} holds a number that is not finite")
    return perceptron
