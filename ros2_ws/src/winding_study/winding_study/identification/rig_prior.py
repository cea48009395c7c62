"""What is known of a rig before a marker has landed, as options of `winding identify --rig`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from winding_core.parameters import parameter
from winding_core.units import FORCE, LENGTH, PLAIN

# Ranges beyond what any rig is.
_SHARE, _LONGEST, _STRONGEST = 10.0, 1.0e3, 1.0e6


@dataclass(frozen=True, kw_only=True)
class RigPriorParameters:
    """The fields of `RigPrior` that describe the machine; its defaults are the paper's rig."""

    young_factor: float = parameter(
        2.0,
        "factor within which Young's modulus lies of the configured one two times in three",
        PLAIN,
        1.001,
        1.0e3,
        option="prior_young_factor",
    )
    free_length: list[float] = parameter(
        [0.8, 1.2], "range of the free length, over the configured one", PLAIN, 1.0e-3, _SHARE,
        option="prior_free_length",
    )  # fmt: skip
    load_share: list[float] = parameter(
        [0.5, 0.9], "range of the load's share that reaches the cylinder", PLAIN, 1.0e-3, _SHARE,
        option="prior_load_share",
    )  # fmt: skip
    guide_drag: list[float] = parameter(
        [0.0, 0.3], "range of the guide's drag", FORCE, 0.0, _STRONGEST, option="prior_guide_drag"
    )
    steady: float = parameter(
        0.5, "probability that the tension does not build up", PLAIN, 0.0, 1.0,
        option="prior_steady",
    )  # fmt: skip
    start_share: list[float] = parameter(
        [0.05, 1.1], "range of the tension's share at the start", PLAIN, 1.0e-3, _SHARE,
        option="prior_start_share",
    )  # fmt: skip
    build_up_length: list[float] = parameter(
        [0.03, 0.6], "range of the wound length over which the tension builds up", LENGTH, 1.0e-4,
        _LONGEST, option="prior_build_up",
    )  # fmt: skip


def prior_ranges(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return fields of `RigPrior` of options that were given."""
    return {
        name: tuple(value) if isinstance(value, list) else value for name, value in values.items()
    }
