"""A joint of an arm and its limits, without the library that moves it."""

from typing import NamedTuple

SPEED_SHARE = 0.9  # A joint may go at this share of its largest speed: the rest is for its servo


class ArmError(ValueError):
    """A URDF cannot be used, or a pose is out of the arm's reach."""


class Joint(NamedTuple):
    """Limits of a joint."""

    name: str  # In description and joint states
    low: float  # Start of its travel [rad or m]
    high: float  # End of its travel [rad or m]
    speed: float  # Largest speed [rad/s or m/s]
