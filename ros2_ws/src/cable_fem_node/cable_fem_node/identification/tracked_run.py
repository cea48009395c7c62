"""What is known of a run whose material is sought: inputs, condition, where markers lie."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.run_inputs import Inputs


class IdentificationError(ValueError):
    """The material cannot be identified from what was given."""


# What the tracker reaches on the small cylinder, for readings that bring no deviation.
DEFAULT_SIGMA_THETA = 3.0e-3
DEFAULT_SIGMA_Z = 0.12e-3


@dataclass(frozen=True, kw_only=True)
class Readings:
    """Where markers were measured on the cylinder."""

    ids: NDArray[np.int64]  # n of Pn, ascending, P0 is not among them, shape (m,)
    theta: FloatArray  # Wound angle relative to P0 [rad], shape (m,)
    z: FloatArray  # Axial position relative to P0 [m], shape (m,)
    sigma_theta: FloatArray  # One standard deviation of each theta [rad], shape (m,)
    sigma_z: FloatArray  # One standard deviation of each z [m], shape (m,)

    def __post_init__(self) -> None:
        if self.ids.size == 0:
            raise IdentificationError("identification needs at least one marker, got none")
        for name in ("theta", "z", "sigma_theta", "sigma_z"):
            values = getattr(self, name)
            if values.shape != self.ids.shape:
                raise IdentificationError(f"{name} needs one value per marker, got {values.size}")
            for marker, value in zip(self.ids, values, strict=True):
                if not math.isfinite(value):
                    raise IdentificationError(f"{name} of P{marker} must be finite, got {value}")
                if name != "z" and not value > 0.0:
                    raise IdentificationError(f"{name} of P{marker} must be positive, got {value}")
        if self.ids[0] < 1 or np.any(np.diff(self.ids) <= 0):
            raise IdentificationError(
                f"markers must be numbered from 1 and ascend, got {self.ids.tolist()}"
            )
        if np.any(np.diff(self.theta) <= 0.0):
            raise IdentificationError(
                f"wound angles must ascend from marker to marker, got {self.theta.tolist()} rad"
            )

    def first(self, count: int) -> Readings:
        """Return the readings of the first markers alone."""
        return Readings(
            **{
                name: getattr(self, name)[:count]
                for name in ("ids", "theta", "z", "sigma_theta", "sigma_z")
            }
        )


@dataclass(frozen=True, kw_only=True)
class TrackedRun:
    """A run of the machine with its tracked markers."""

    config: WindingConfig  # Everything of the model but what is sought
    inputs: Inputs  # Machine's motion and span tension, shape (n,) of INPUT_DTYPE
    readings: Readings  # Where markers lie
    # Pull [N] that was commanded at cylinder angles [rad], of one shape; None: none was.
    commanded: Callable[[FloatArray], FloatArray] | None = None

    def __post_init__(self) -> None:
        if self.config.case.material.prony.shares:
            raise IdentificationError(
                "a modulus is identified of an elastic cable: leave out prony, and take the "
                "estimate for the modulus of the time that a run takes"
            )
        if self.inputs.size < 2:
            raise IdentificationError(
                f"a run needs at least two samples of the machine, got {self.inputs.size}"
            )
        last, count = int(self.readings.ids[-1]), self.config.case.marker_count
        if last > count:
            raise IdentificationError(f"the condition has markers P1 to P{count}, got P{last}")
        if not self.highest_tension > 0.0:
            raise IdentificationError(
                f"an unstretched cable tells nothing: the tension is at most "
                f"{self.highest_tension:g} N"
            )

    @property
    def highest_tension(self) -> float:
        """Greatest span tension of the run [N]."""
        return float(self.tensions(self.inputs).max())

    def tensions(self, inputs: Inputs) -> FloatArray:
        """Return the span tension [N] of inputs, see `span_tensions`."""
        return span_tensions(self.config, inputs)


def span_tensions(config: WindingConfig, inputs: Inputs) -> FloatArray:
    """Return the span tension [N] of inputs: measured, or the configuration's law."""
    case, law = config.case, config.tension_law
    found = inputs["tension"].copy()
    stated = np.isnan(found)
    wound = case.centreline_radius * np.maximum(inputs["cylinder_angle"][stated], 0.0)
    found[stated] = [law(case.weight, case.cylinder_diameter, way) for way in wound.tolist()]
    return np.asarray(found)
