"""What is known of the rig that winds before a marker has landed; no kernel is loaded for it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from winding_core.parameters import parameter
from winding_core.units import FORCE, LENGTH, PLAIN

_SHARE, _LONGEST, _STRONGEST = 10.0, 1.0e3, 1.0e6  # Ranges beyond what any rig is


@dataclass(frozen=True, kw_only=True)
class RigPrior:
    """What the construction of the machine and the data sheet state before a marker has landed.

    Ranges are even; two equal ends state that a number is known. The defaults are the paper's rig;
    guide and pulleys take between a tenth and a half of a load.
    """

    young_factor: float = parameter(
        2.0,
        "factor within which Young's modulus lies of the configured one two times in three",
        PLAIN,
        1.001,
        1.0e3,
        option="prior_young_factor",
    )
    free_length: Sequence[float] = parameter(
        [0.8, 1.2], "range of the free length, over the configured one", PLAIN, 1.0e-3, _SHARE,
        option="prior_free_length",
    )  # fmt: skip
    load_share: Sequence[float] = parameter(
        [0.5, 0.9], "range of the load's share that reaches the cylinder", PLAIN, 1.0e-3, _SHARE,
        option="prior_load_share",
    )  # fmt: skip
    guide_drag: Sequence[float] = parameter(
        [0.0, 0.3], "range of the guide's drag", FORCE, 0.0, _STRONGEST, option="prior_guide_drag"
    )
    steady: float = parameter(
        0.5, "probability that the tension does not build up", PLAIN, 0.0, 1.0,
        option="prior_steady",
    )  # fmt: skip
    # Range of f where it does build up; the span may start nearly slack.
    start_share: Sequence[float] = parameter(
        [0.05, 1.1], "range of the tension's share at the start", PLAIN, 1.0e-3, _SHARE,
        option="prior_start_share",
    )  # fmt: skip
    build_up_length: Sequence[float] = parameter(
        [0.03, 0.6], "range of the wound length over which the tension builds up", LENGTH, 1.0e-4,
        _LONGEST, option="prior_build_up",
    )  # fmt: skip
    # Range of how far behind the landing point friction begins to hold, over how far that is on the
    # rod with its elements; those of a cable have no length.
    held: Sequence[float] = parameter([0.4, 1.1], "range of where friction begins to hold")
    # Range of Coulomb friction, even in its logarithm; two zeros: as configured.
    friction: Sequence[float] = parameter([0.0, 0.0], "range of the friction")
    # Range of C01 / (C10 + C01), where the law is neo_hookean or mooney_rivlin.
    law_share: Sequence[float] = parameter([0.0, 0.0], "range of the share of C01")
    # Range of the share of a commanded pull by which the tension stays behind.
    brake_friction: Sequence[float] = parameter([0.0, 0.0], "range of the brake's own friction")
    eye: float = parameter(0.0, "standard deviation of the eye's place on the carriage [m]")
    # Standard deviation of what the camera's distance does to z, relative.
    camera_scale: float = parameter(0.0, "standard deviation of the scale of z")
    fixing: float = parameter(0.0, "standard deviation of where P0 was fixed along the cable [m]")
    scatter: float = parameter(0.0, "standard deviation of other markers' places [m]")

    def __post_init__(self) -> None:
        for item in fields(self):
            values = np.atleast_1d(getattr(self, item.name))
            if not np.isfinite(values).all():
                raise ValueError(f"{item.name} must be finite, got {values.tolist()}")
            if values.size == 2 and values[0] > values[1]:
                raise ValueError(f"{item.name} must ascend, got {values.tolist()}")
        for name in ("free_length", "load_share", "start_share", "build_up_length", "held"):
            if not getattr(self, name)[0] > 0.0:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)[0]}")
        for name in ("eye", "camera_scale", "fixing", "scatter"):
            if getattr(self, name) < 0.0:
                raise ValueError(f"{name} must not be negative, got {getattr(self, name)}")
        if self.guide_drag[0] < 0.0:
            raise ValueError(f"guide_drag must not be negative, got {self.guide_drag[0]} N")
        if not self.young_factor > 1.0:
            raise ValueError(f"young_factor must exceed 1, got {self.young_factor}")
        if not 0.0 <= self.steady <= 1.0:
            raise ValueError(f"steady must lie in [0, 1], got {self.steady}")

    @property
    def young_deviation(self) -> float:
        """Standard deviation of ln E."""
        return math.log(self.young_factor)


# The tension at the cylinder is the stated one: a load cell in the span.
KNOWN_TENSION = RigPrior(
    load_share=(1.0, 1.0),
    guide_drag=(0.0, 0.0),
    steady=1.0,
    build_up_length=(0.2, 0.2),
    held=(1.0, 1.0),
)
# What a run is commissioned with: friction and law are sought, brake, eye and camera allowed for.
CELL = RigPrior(
    friction=(0.06, 2.0),
    law_share=(0.0, 0.6),
    brake_friction=(0.0, 0.05),
    eye=0.3e-3,
    camera_scale=1.7e-3,
)
