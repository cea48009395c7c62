"""A cable as it lies at the end of a run, for a picture of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.cases import Case, paper_case
from winding_study.runs.case_result import CaseResult

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class WoundCable:
    """A wound cable in the frame of the laboratory.

    Attributes:
        case: What was wound.
        nodes: Centreline, P0 first [m], shape (n, 3), n at least 2.
        strain: Nominal strain there, shape (n,).
        marks: Wound angle [rad] and axial position [m] of the wound markers, relative to P0;
            number 0 is P0, which is missing where the cable does not reach back to it.
    """

    case: Case
    nodes: Array = field(compare=False, repr=False)
    strain: Array = field(compare=False, repr=False)
    marks: Mapping[int, tuple[float, float]]

    def __post_init__(self) -> None:
        if self.nodes.shape != (len(self.strain), 3) or len(self.strain) < 2:
            raise ValueError(f"a cable needs two nodes or more, got shape {self.nodes.shape}")

    @property
    def wound_strain(self) -> Array:
        """Strain of what lies on the cylinder, shape (k,)."""
        distance = np.hypot(self.nodes[:, 0], self.nodes[:, 1])
        loose = distance > 1.02 * self.case.centreline_radius
        wound = int(np.argmax(loose)) if loose.any() else len(loose)
        return self.strain[1 : max(2, wound)]


def cable_of(result: CaseResult) -> WoundCable:
    """Return the cable of a case of Table 1."""
    return WoundCable(
        case=paper_case(result.case),
        nodes=result.nodes,
        strain=result.strain,
        marks={0: (0.0, 0.0)} | {n: (lay.theta, lay.z) for n, lay in result.lays.items()},
    )
