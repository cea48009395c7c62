"""A drive programme whose guide follows what is wanted of the lay."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from winding_core.cable.condition import ResolvedCondition
from winding_core.helix import FloatOrArray, like
from winding_core.lay.guide_path import guide_path, lags_of, within
from winding_core.lay.limits import PlanLimits
from winding_core.lay.program import LayProgram
from winding_core.lay.rounding import rounded_for
from winding_core.lay.smoothed_line import REACH, SmoothedLine
from winding_core.machine.drive import DriveProfile


@dataclass(frozen=True, kw_only=True)
class GuidedDrive(DriveProfile):
    """The cylinder of a drive programme, and a guide that goes along a path over its angle."""

    path: SmoothedLine

    @classmethod
    def along(cls, program: LayProgram, what: ResolvedCondition, limits: PlanLimits) -> Self:
        """Return the motion that lays a program; the guide begins at P0 and then takes its lead.

        Raises:
            LayProgramError: Layers would reach the guide.
        """
        width = rounded_for(program, what, limits).width
        path = within(guide_path(program, lags_of(program, what), 0.0), *limits.travel)
        lead, begun = float(path.at(0.0)), REACH * width
        place = int(np.searchsorted(path.theta, begun))
        path = replace(
            path,
            theta=np.insert(path.theta, place, begun),
            bends=np.insert(path.bends, place, 0.0),
            steps=np.insert(path.steps, place, lead),
            value=path.value - lead,
            width=width,
        )
        drive = what.drive
        return cls(
            angular_speed=drive.angular_speed,
            feed_speed=drive.feed_speed,
            ramp_time=drive.ramp_time,
            path=path,
        )

    def speeds(self, t: FloatOrArray) -> tuple[FloatOrArray, FloatOrArray]:
        """See `DriveProfile.speeds`."""
        angle, (speed, _) = super().positions(t)[0], super().speeds(t)
        return speed, like(t, speed * self.path.at(angle, 1))

    def positions(self, t: FloatOrArray) -> tuple[FloatOrArray, FloatOrArray]:
        """See `DriveProfile.positions`."""
        angle = super().positions(t)[0]
        return angle, like(t, self.path.at(angle))
