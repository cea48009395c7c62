"""The winding condition as parameters that every node of a graph shares."""

from __future__ import annotations

from dataclasses import dataclass

from winding_core.cases import Case, paper_case
from winding_core.drive import (
    PAPER_ANGULAR_SPEED,
    PAPER_DURATION,
    PAPER_FEED_SPEED,
    PAPER_RAMP_TIME,
    DriveProfile,
)
from winding_core.fleet_angle import PAPER_FREE_LENGTH
from winding_core.parameters import ParameterError, parameter

_OWN = ("cylinder_diameter", "cable_diameter", "weight", "marker_spacing")


@dataclass(frozen=True, kw_only=True)
class ConditionParameters:
    """Parameters that say what is wound, and how."""

    case: int = parameter(4, "row of the paper's Table 1; 0 for a condition of one's own", low=0)
    cylinder_diameter: float = parameter(0.0, "cylinder diameter [m], with case 0", low=0.0)
    cable_diameter: float = parameter(0.0, "undeformed cable diameter [m], with case 0", low=0.0)
    weight: float = parameter(0.0, "dead weight on the cable's end [N], with case 0", low=0.0)
    marker_spacing: float = parameter(
        0.0, "marker spacing along the undeformed cable [m], with case 0", low=0.0
    )
    angular_speed: float = parameter(
        PAPER_ANGULAR_SPEED, "cylinder speed after the ramp [rad/s]", low=0.01, high=20.0
    )
    feed_speed: float = parameter(
        PAPER_FEED_SPEED, "carriage speed after the ramp [m/s]", low=0.0, high=0.1
    )
    ramp_time: float = parameter(
        PAPER_RAMP_TIME, "time of the linear speed ramp [s]", low=0.05, high=60.0
    )
    duration: float = parameter(
        PAPER_DURATION, "simulated length of a run [s]", low=0.1, high=3.6e3
    )
    free_length: float = parameter(
        PAPER_FREE_LENGTH, "tangent span between cylinder and guide [m]", low=0.01, high=5.0
    )

    def condition(self) -> Case:
        """Return the case that the parameters name or spell out.

        Raises:
            ParameterError: The case is not in Table 1, or own values are missing or contradict it.
        """
        own = {name: getattr(self, name) for name in _OWN}
        try:
            if self.case == 0:
                return Case(**own)
            given = [name for name, value in own.items() if value != 0.0]
            if given:
                raise ParameterError(
                    f"{given[0]} is given beside case {self.case}; set case to 0 for a "
                    "condition of one's own"
                )
            return paper_case(self.case)
        except ValueError as error:
            raise ParameterError(str(error)) from error

    def drive(self) -> DriveProfile:
        """Return the drive profile."""
        return DriveProfile(
            angular_speed=self.angular_speed,
            feed_speed=self.feed_speed,
            ramp_time=self.ramp_time,
        )
