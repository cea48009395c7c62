"""Rods, readings and tracked runs that tests of the solver share."""

import dataclasses
from typing import Any, TypeVar

import numpy as np

from cable_fem_node.identification import Readings, TrackedRun
from cable_fem_node.winding.prediction import predict
from cable_fem_node.winding.winding_config import WindingConfig
from cable_fem_node.winding.winding_model import WindingModel
from winding_core.cable.cases import Case, Material, paper_case
from winding_core.machine.drive import PAPER_DURATION, DriveProfile
from winding_core.markers import is_wound
from winding_core.run_inputs import planned_inputs

Model = TypeVar("Model", bound=WindingModel)

CASE = paper_case(4)
CONFIG = WindingConfig(case=CASE)
DRIVE = DriveProfile()


def case_of(number: int, **fields: Any) -> WindingConfig:
    return WindingConfig(case=paper_case(number), **fields)


def follow(model: Model, until: float, period: float = 0.02, tension: float | None = None) -> Model:
    """Let a model follow the paper's machine to a time [s], call by call."""
    begin = model.time
    for i in range(1, round((until - begin) / period) + 1):
        t = begin + period * i
        model.advance_to(t, DRIVE.reading_at(t), tension)
    return model


def cable_on(
    cylinder: float, diameter: float, weight: float, young: float = 2.6e6, **own: Any
) -> Case:
    """Return a case of one marker: diameters [m], weight [N], modulus [Pa]."""
    size = {"cylinder_diameter": cylinder, "cable_diameter": diameter, "weight": weight}
    markers = {"marker_count": 1, "marker_spacing": 0.1}
    return Case(material=Material(young=young), **{**size, **markers, **own})


def readings(**changed: Any) -> Readings:
    """Return readings from P1 on, P1 and P2 of case 4 by default; one deviation is everybody's."""
    values = {"theta": np.array([6.5, 13.1]), "z": np.array([0.004, 0.015])}
    values |= {"sigma_theta": 3e-3, "sigma_z": 1e-4, **changed}
    count = len(values["theta"])
    values.setdefault("ids", np.arange(1, count + 1))
    for name in ("sigma_theta", "sigma_z"):
        if np.isscalar(values[name]):
            values[name] = np.full(count, values[name])
    return Readings(**values)


def tracked(config: WindingConfig = CONFIG, duration: float = 12.0, **changed: Any) -> TrackedRun:
    """Return a run of the paper's machine with `readings`."""
    inputs = planned_inputs(DRIVE, duration)
    return TrackedRun(config=config, inputs=inputs, readings=readings(**changed))


def wound(
    config: WindingConfig, duration: float = PAPER_DURATION, segment: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return theta [rad] and z [m] of P1 to Pn that a rod of its own or other elements lays."""
    rod = dataclasses.replace(config, segment_length=segment)
    markers = predict(rod, DRIVE, duration, rate=1.0).markers[1:]
    landed = markers[is_wound(markers)]
    return landed["theta"].astype(float), landed["z"].astype(float)
