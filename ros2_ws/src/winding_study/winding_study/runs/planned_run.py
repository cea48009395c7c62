"""A run that is decided but not wound: everything that can be refused is refused here."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from cable_fem_node.winding.prediction import Prediction, predict, refuse_overlap
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.drive import PAPER_DURATION, DriveProfile
from winding_study.runs.run_parameters import ELEMENTS
from winding_study.runs.run_store import run_key
from winding_study.runs.solver_version import solver_version


@dataclass(frozen=True, kw_only=True)
class PlannedRun:
    """One run of the solver, checked, not yet wound.

    Attributes:
        config: The model.
        drive: How the machine moves.
        duration: Time to wind [s].
        element: One of ELEMENTS.

    Raises:
        ValueError: The duration is not positive, the element is unknown or has no stiffness
            factors, or the feed would lay the cable over itself.
    """

    config: WindingConfig
    drive: DriveProfile = field(default_factory=DriveProfile)
    duration: float = PAPER_DURATION
    element: str = "rod"

    def __post_init__(self) -> None:
        if self.element not in ELEMENTS:
            raise ValueError(f"element must be {' or '.join(ELEMENTS)}, got {self.element!r}")
        if not (math.isfinite(self.duration) and self.duration > 0.0):
            raise ValueError(f"duration must be positive and finite, got {self.duration}")
        if self.element == "solid":
            self.config.refuse_stiffness_factors()
        refuse_overlap(self.config, self.drive)

    @property
    def key(self) -> str:
        """Key of the run's results in a store, with the solver that is installed here."""
        return run_key(self, solver_version())

    def warm_up(self) -> None:
        """Load or build the machine code, so that processes started later find it."""
        if self.element == "rod":
            RodWinding(self.config).compile()

    def wind(self, progress: Callable[[float], None] | None = None) -> Prediction:
        """Wind the run; arguments and errors as `cable_fem_node.winding.prediction.predict`."""
        if self.element == "solid":
            # Imported late: most runs are rods, and its kernels take their time to load.
            from cable_fem_node.winding.solid_winding import predict_solid  # noqa: PLC0415

            return predict_solid(self.config, self.drive, self.duration, progress)
        return predict(self.config, self.drive, self.duration, progress)
