"""What the simulated rig does to its cable, told to no node."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

# What is drawn at random lies evenly between these. Start share and build-up length: the paper's
# rig and one standard error to either side (`winding_study.paper.calibration`, neo_hookean).
FREE_LENGTH = (0.160, 0.230)
LOAD_SHARE = (0.5, 0.9)
DRAG = (0.0, 0.3)
START_SHARE = (0.20, 0.33)
BUILD_UP_LENGTH = (0.13, 0.39)
BRAKE_FRICTION = (0.01, 0.04)

_AT_LEAST_ZERO = ("drag", "guide_play", "brake_friction", "bending", "start_share")


@dataclass(frozen=True, kw_only=True)
class HiddenRig:
    """Properties of the simulated rig that lie between what it measures and where its cable lies.

    Attributes:
        free_length: Tangent span L between the contact line and the eye, across the axis [m].
        load_share: Share of the pull at the guide that reaches the cylinder.
        drag: Constant friction of the guide, which pulls too [N].
        start_share: Share of the span's tension at P0, f0 of `winding_core.machine.tension.RigTension`.
        build_up_length: Wound length over which the tension builds up, L_c [m].
        guide_play: Way that the carriage goes back before the eye follows it [m].
        brake_friction: Share of the pull by which the tension may stay behind a changed pull,
            to either side.
        bending: Factor on the section's bending stiffness EI; 0 for a cable without any.
    """

    free_length: float
    load_share: float
    drag: float
    start_share: float = 1.0
    build_up_length: float = 0.26
    guide_play: float = 0.0
    brake_friction: float = 0.0
    bending: float = 0.0

    def __post_init__(self) -> None:
        for name in ("free_length", "load_share", "build_up_length"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be positive and finite, got {value}")
        for name in _AT_LEAST_ZERO:
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} must be finite and not negative, got {value}")
        if not self.brake_friction < 1.0:
            raise ValueError(f"brake_friction must be below 1, got {self.brake_friction}")

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> HiddenRig:
        """Draw a plausible rig; guide play and bending are the same in all."""
        return cls(
            free_length=rng.uniform(*FREE_LENGTH),
            load_share=rng.uniform(*LOAD_SHARE),
            drag=rng.uniform(*DRAG),
            start_share=rng.uniform(*START_SHARE),
            build_up_length=rng.uniform(*BUILD_UP_LENGTH),
            guide_play=0.3e-3,
            brake_friction=rng.uniform(*BRAKE_FRICTION),
            bending=1.0,
        )
