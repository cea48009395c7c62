"""Models of h that can be stored and used without a learning library: network, rig's physics."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass
from typing import Any, Protocol

import numpy as np

from correction_node.models.dataset import (
    INPUTS,
    Array,
    LengthCell,
    MarkerCondition,
    lengths,
    strain,
)
from correction_node.models.process import Process
from winding_core.cable.cases import Case
from winding_core.cable.material_law import LAWS
from winding_core.lay.quasi_static import QuasiStaticLay
from winding_core.machine.tension import START, DeadWeight, RigTension, fit_rig_tension

RIG_LAW = "neo_hookean"
Tensors = Mapping[str, Array]


def case_of(markers: Sequence[MarkerCondition]) -> Case:
    """Return the case that markers of one cable belong to."""
    last = max(markers, key=lambda condition: condition.marker)
    return Case(
        number=last.case,
        cylinder_diameter=last.cylinder_diameter,
        cable_diameter=last.cable_diameter,
        weight=0.25 * math.pi * last.cable_diameter**2 * last.tension,
        marker_spacing=last.original_length / last.marker,
        marker_count=last.marker,
    )


class LayOns:
    """The quasi-static lay-on of every cable among some markers.

    Args:
        conditions: Markers; those with the same case number are on one cable.
        law: Material law.
    """

    def __init__(self, conditions: Sequence[MarkerCondition], law: str) -> None:
        cables: dict[int, list[MarkerCondition]] = {}
        for condition in conditions:
            cables.setdefault(condition.case, []).append(condition)
        self._cables: Mapping[int, QuasiStaticLay] = {
            case: QuasiStaticLay(case_of(markers), law) for case, markers in cables.items()
        }

    def lengths(
        self, conditions: Sequence[MarkerCondition], tension: DeadWeight | RigTension
    ) -> Array:
        """Return S_n [m] of markers on these cables under a span tension, shape (n,)."""
        asked = {condition.case for condition in conditions}
        laid = {case: self._cables[case].curve_lengths(tension) for case in asked}
        return np.array([laid[c.case][c.marker - 1] for c in conditions])


def fit_rig(cells: Sequence[LengthCell], lay_ons: LayOns, start: RigTension = START) -> RigTension:
    """Return the span-tension law with the smallest sum of squared relative length errors.

    Args:
        cells: Measured cells; at least six.
        lay_ons: Of these cells' cables.
        start: Where the search begins.
    """
    _, measured = lengths(cells)
    return fit_rig_tension(lambda law: lay_ons.lengths(cells, law) / measured - 1.0, start).tension


def reference_law(cells: Sequence[MarkerCondition]) -> tuple[str, float]:
    """Return the material law whose dead-weight lay-on is closest to predicted lengths.

    Returns:
        The law and its largest relative difference from S_FEM.
    """
    s_fem = np.array([cell.s_fem for cell in cells])
    distance = {
        law: float(np.abs(LayOns(cells, law).lengths(cells, DeadWeight()) / s_fem - 1.0).max())
        for law in LAWS
    }
    nearest = min(distance, key=lambda law: distance[law])
    return nearest, distance[nearest]


@dataclass(frozen=True, kw_only=True)
class Perceptron:
    """Layers with ReLU between them."""

    weights: tuple[Array, ...]  # Of each layer, shape (outputs, inputs)
    biases: tuple[Array, ...]  # Of each layer, shape (outputs,)
    low: Array  # Smallest training inputs, shape (k,); normalised to -1
    high: Array  # Largest training inputs, shape (k,); normalised to +1

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
    """h = perceptron(inputs)."""

    inputs: str  # Name of what it looks at, one of INPUTS
    perceptron: Perceptron  # The fitted network

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
    """

    tension: RigTension  # Span tension behind the weight
    residual: NetworkModel | None = None  # S over S_rig, or None for the physics alone

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


@dataclass(frozen=True, kw_only=True)
class ProcessModel:
    """ln h as a process over inputs of a condition; 1 far from what it was learned from.

    A run is pulled harder or less hard than another one: what it has of its own grows with the
    strain.
    """

    process: Process  # Of ln(S_EXP / S_FEM)
    inputs: str = "cable"  # One of INPUTS

    def h(self, conditions: Sequence[MarkerCondition]) -> Array:
        """Return h, shape (n,)."""
        return np.exp(self.process.at(INPUTS[self.inputs](conditions))[0])

    def bounds(self, conditions: Sequence[MarkerCondition]) -> Array:
        """Return relative half-widths of 90 % intervals, shape (n,)."""
        inputs = INPUTS[self.inputs](conditions)
        return np.expm1(self.process.half_width(inputs, strain(conditions)))

    def tensors(self) -> dict[str, Array]:
        """Return every number of the process."""
        return self.process.tensors("process")

    def form(self) -> dict[str, Any]:
        """Return the kind and the inputs."""
        return {"kind": "process", "inputs": self.inputs}


def read_model(form: Mapping[str, Any], tensors: Tensors) -> FactorModel:
    """Return the model that `form` and `tensors` describe.

    Raises:
        KeyError, ValueError, TypeError: They do not.
    """
    if form["kind"] == "process":
        # Those of before are without the cable's own.
        inputs = form.get("inputs", "dimensionless")
        return ProcessModel(process=Process.read("process", tensors), inputs=inputs)
    if form["kind"] == "network":
        return _network(form, tensors)
    if form["kind"] != "rig":
        raise ValueError(f"kind must be network, rig or process, got {form['kind']!r}")
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
