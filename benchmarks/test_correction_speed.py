"""Speed of the correction beside the multiplication that it amounts to, in one session."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from correction_node.live.corrector import Corrector
from correction_node.models.weights import SHIPPED, load_factor, weights_directory
from rows import least
from winding_core.cable.cases import paper_case
from winding_core.markers import CORRECTED_DTYPE, Markers, wound_markers

CASE = paper_case(7)
REPEATS, CALLS = 5, 400
# Measured 10 to 13: inputs are looked at, the interval is added. The rest is for other processors.
CORRECTION_OVER_MULTIPLICATION = 30.0


def markers() -> Markers:
    """Return P0 to P4 of a run."""
    return wound_markers(
        ids=[0, 1, 2, 3, 4],
        theta=[0.0, 7.05, 13.91, 18.94, 25.75],
        z=[0.0, 0.00831, 0.02207, 0.03966, 0.05786],
        radius=CASE.centreline_radius,
        cylinder_angle=30.0,
    )


def multiplied(predicted: Markers) -> np.ndarray:
    """Return records with lengths times a number: what no correction can do without."""
    corrected = np.zeros(predicted.size, CORRECTED_DTYPE)
    for name in predicted.dtype.names:
        corrected[name] = predicted[name]
    corrected["s"] = 1.386 * predicted["s"]
    return corrected


def seconds(action: Callable[[], Any]) -> float:
    """Return the processor time of one call [s]."""
    started = time.process_time()
    for _ in range(CALLS):
        action()
    return (time.process_time() - started) / CALLS


@pytest.mark.parametrize("name", SHIPPED)
def test_correction_beside_a_multiplication(bench: Any, name: str) -> None:
    corrector, predicted = Corrector(load_factor(weights_directory(name))), markers()
    corrector.factor(CASE)
    correction, plain = least(
        REPEATS,
        lambda: seconds(lambda: corrector.correct(predicted, CASE)),
        lambda: seconds(lambda: multiplied(predicted)),
    )
    bench.row(f"correction_us_{name}", 1.0e6 * correction, "us")
    bench.row(
        f"correction_over_multiplication_{name}",
        correction / plain,
        "",
        bar=CORRECTION_OVER_MULTIPLICATION,
    )
