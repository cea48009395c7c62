"""Predict, plan, track, identify and correct how a flexible cable lays itself on a cylinder.

The public Python interface. Every other package of the project is internal and may change between
versions. Quantities are in SI units, arrays are NumPy arrays, and results are records whose
attributes are named with their shape and unit. Nothing here needs ROS or a running graph.

    >>> import cable_winding as cw
    >>> run = cw.predict(cw.Condition(case=4))
    >>> run.markers.s  # length from P0 to each marker [m], shape (5,)
"""

from __future__ import annotations

import importlib
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cable_winding.correction import FEATURES, Correction, load_lengths
    from cable_winding.material import Modulus, fit_tensile, identify
    from cable_winding.motion import MotionPlan, plan
    from cable_winding.prediction import Cable, Markers, Prediction, predict
    from cable_winding.recording import Run, list_topics, read_bag, read_run
    from cable_winding.tracking import Tracking, track
    from winding_core.cable.condition import Condition
    from winding_core.markers import MarkerFlag
    from winding_study.plans.drum_plan import DrumPlanParameters

__all__ = [
    "FEATURES",
    "Cable",
    "Condition",
    "Correction",
    "DrumPlanParameters",
    "MarkerFlag",
    "Markers",
    "Modulus",
    "MotionPlan",
    "Prediction",
    "Run",
    "Tracking",
    "fit_tensile",
    "identify",
    "list_topics",
    "load_lengths",
    "plan",
    "predict",
    "read_bag",
    "read_run",
    "track",
]

_MODULES = {
    "cable_winding.correction": ("FEATURES", "Correction", "load_lengths"),
    "cable_winding.material": ("Modulus", "fit_tensile", "identify"),
    "cable_winding.motion": ("MotionPlan", "plan"),
    "cable_winding.prediction": ("Cable", "Markers", "Prediction", "predict"),
    "cable_winding.recording": ("Run", "list_topics", "read_bag", "read_run"),
    "cable_winding.tracking": ("Tracking", "track"),
    "winding_core.cable.condition": ("Condition",),
    "winding_core.markers": ("MarkerFlag",),
    "winding_study.plans.drum_plan": ("DrumPlanParameters",),
}
_HOMES = {name: module for module, names in _MODULES.items() for name in names}

try:
    __version__ = version("cable-winding-twin")
except PackageNotFoundError:
    # Built by colcon, package by package.
    __version__ = version("cable_winding")


if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        # An import costs what is used: no kernels, OpenCV or learning library before that.
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
