"""Models of h that can be stored and used without a learning library."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass
from typing import Any, Protocol

import numpy as np

from correction_node.models.dataset import Array, MarkerCondition
from correction_node.models.inputs import INPUTS
from correction_node.models.perceptron import Perceptron
from correction_node.models.rig import RIG_LAW, LayOns
from winding_core.machine.tension import RigTension

Tensors = Mapping[str, Array]


class FactorModel(Protocol):
    """Something that gives h for markers."""

    def h(self, conditions: Sequence[MarkerCondition]) -> Array:
        """Return h, shape (n,)."""
        ...

    def tensors(self) -> dict[str, Array]:
        """Return every number of the model by name."""
        ...

    def form(self) -> dict[str, Any]:
        """Return what is no number: JSON values that `read_model` understands."""
        ...


@dataclass(frozen=True, kw_only=True)
class NetworkModel:
    """h = perceptron(inputs).

    Attributes:
        inputs: Name of what it looks at, one of INPUTS.
        perceptron: The fitted network.
    """

    inputs: str
    perceptron: Perceptron

    def h(self, conditions: Sequence[MarkerCondition]) -> Array:
        """Return h, shape (n,)."""
        return self.perceptron.h(INPUTS[self.inputs](conditions))

    def tensors(self) -> dict[str, Array]:
        """Return the layers and the range of the inputs."""
        named = {"low": self.perceptron.low, "high": self.perceptron.high}
        for n, (weight, bias) in enumerate(
            zip(self.perceptron.weights, self.perceptron.biases, strict=True), start=1
        ):
            named[f"layer{n}.weight"] = weight
            named[f"layer{n}.bias"] = bias
        return named

    def form(self) -> dict[str, Any]:
        """Return the kind, the inputs and the number of layers."""
        return {"kind": "network", "inputs": self.inputs, "layers": len(self.perceptron.weights)}


@dataclass(frozen=True, kw_only=True)
class RigModel:
    """h = S_rig / S_FEM, times a learned factor of what the rig's physics leaves over.

    S_rig is the quasi-static lay-on of a Neo-Hookean cable under the span tension of the rig.

    Attributes:
        tension: Span tension behind the weight.
        residual: S over S_rig, or None for the physics alone.
    """

    tension: RigTension
    residual: NetworkModel | None = None

    def h(self, conditions: Sequence[MarkerCondition]) -> Array:
        """Return h, shape (n,)."""
        laid = LayOns(conditions, RIG_LAW).lengths(conditions, self.tension)
        h: Array = laid / np.array([condition.s_fem for condition in conditions])
        return h if self.residual is None else h * self.residual.h(conditions)

    def tensors(self) -> dict[str, Array]:
        """Return the five numbers of the tension law, and the residual's."""
        residual = {} if self.residual is None else self.residual.tensors()
        return {"rig.tension": np.array(astuple(self.tension)), **residual}

    def form(self) -> dict[str, Any]:
        """Return the kind and the residual's form."""
        residual = None if self.residual is None else self.residual.form()
        return {"kind": "rig", "law": RIG_LAW, "residual": residual}


def read_model(form: Mapping[str, Any], tensors: Tensors) -> FactorModel:
    """Return the model that `form` and `tensors` describe.

    Raises:
        KeyError, ValueError, TypeError: They do not.
    """
    if form["kind"] == "network":
        return _network(form, tensors)
    if form["kind"] != "rig":
        raise ValueError(f"kind must be network or rig, got {form['kind']!r}")
    if form["law"] != RIG_LAW:
        raise ValueError(f"law must be {RIG_LAW}, got {form['law']!r}")
    offset, share, gain, start, length = (float(number) for number in tensors["rig.tension"])
    return RigModel(
        tension=RigTension(
            offset=offset,
            weight_share=share,
            diameter_gain=gain,
            start_share=start,
            build_up_length=length,
        ),
        residual=None if form["residual"] is None else _network(form["residual"], tensors),
    )


def _network(form: Mapping[str, Any], tensors: Tensors) -> NetworkModel:
    if form["inputs"] not in INPUTS:
        raise ValueError(f"inputs must be one of {', '.join(INPUTS)}, got {form['inputs']!r}")
    numbers = range(1, int(form["layers"]) + 1)
    perceptron = Perceptron(
        weights=tuple(tensors[f"layer{n}.weight"] for n in numbers),
        biases=tuple(tensors[f"layer{n}.bias"] for n in numbers),
        low=tensors["low"],
        high=tensors["high"],
    )
    # Layers that do not fit each other fail here, not in the middle of a run.
    perceptron.h(perceptron.low[np.newaxis])
    return NetworkModel(inputs=form["inputs"], perceptron=perceptron)
