"""Parameters of the rig node."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from winding_core.arm.opening import open_arm
from winding_core.cable.condition import Condition
from winding_core.lay.drum_parameters import DrumShape
from winding_core.markers import MarkerLook
from winding_core.parameters import parameter
from winding_core.run_options import LAY_MEANING, SimulatedCamera, SimulatedMachine
from winding_rig_node.lay.known_lay import (
    FEM,
    PAPER,
    CableLay,
    HiddenCable,
    published_lay,
    simulated_lay,
)
from winding_rig_node.lay.lay_law import MOTION_LAYS
from winding_rig_node.machine.commander import CARRIAGE_LIMITS, CYLINDER_LIMITS, CommandLimits

if TYPE_CHECKING:
    from winding_core.arm.arm_path import ArmPath


@dataclass(frozen=True, kw_only=True)
class RigParameters(SimulatedCamera, SimulatedMachine, MarkerLook, DrumShape, Condition):
    """What is wound, how fast simulated time runs, and what the camera sees."""

    lay: str = parameter(PAPER, LAY_MEANING, choices=(PAPER, FEM, *MOTION_LAYS))
    pace_topics: str = parameter(
        "", "comma-separated topics whose stamps hold simulated time back; empty for none"
    )
    max_lead: float = parameter(
        0.25, "how far simulated time may lead the slowest paced topic [s]", low=0.01, high=2.0
    )
    pace_timeout: float = parameter(
        30.0, "wall time without an answer of a paced topic after which the rig fails [s]", low=0.1
    )
    camera_elsewhere: bool = parameter(
        False, "whether the camera runs in another process and this one shows no frames"
    )
    preview_quality: int = parameter(80, "JPEG quality of the preview", low=1, high=100)
    supervisor_timeout: float = parameter(
        0.0,
        "wall time without a sign of life of the orchestrator after which both axes are stopped "
        "[s]; 0 for a machine that is run by hand",
        low=0.0,
        high=60.0,
    )
    cylinder_speed_limit: float = parameter(
        CYLINDER_LIMITS.speed, "largest commanded cylinder speed [rad/s]", low=0.01, high=200.0
    )
    cylinder_acceleration_limit: float = parameter(
        CYLINDER_LIMITS.acceleration,
        "largest commanded cylinder acceleration [rad/s^2]",
        low=0.1,
        high=2000.0,
    )
    carriage_speed_limit: float = parameter(
        CARRIAGE_LIMITS.speed, "largest commanded carriage speed [m/s]", low=1.0e-4, high=2.0
    )
    carriage_acceleration_limit: float = parameter(
        CARRIAGE_LIMITS.acceleration,
        "largest commanded carriage acceleration [m/s^2]",
        low=0.01,
        high=20.0,
    )
    carriage_travel: list[float] = parameter(
        [CARRIAGE_LIMITS.low, CARRIAGE_LIMITS.high],
        "start and end of the carriage's travel under commands [m]",
        low=-10.0,
        high=10.0,
    )
    brake_limits: list[float] = parameter(
        [CommandLimits.low_tension, CommandLimits.high_tension],
        "smallest and largest pull that the brake can be commanded to [N]",
        low=0.0,
        high=1000.0,
    )
    brake_time: float = parameter(
        CommandLimits.brake_time, "time constant of the brake [s]", low=0.001, high=10.0
    )
    command_timeout: float = parameter(
        CommandLimits.timeout,
        "how long a target holds that is not reached yet, and how old a command may be [s]",
        low=0.02,
        high=60.0,
    )
    inject_faults: bool = parameter(
        False, "whether faults may be put into sensors and topics on purpose"
    )
    inject_fault: str = parameter(
        "",
        "faults that are in the signals now: target:kind[:amount], separated by commas; kinds are "
        "off, stuck, garbage, wrong, slow, delayed, intermittent",
        read_only=False,
    )

    @property
    def follows_commands(self) -> bool:
        """Whether the lay follows what the machine does, rather than its drive programme.

        Raises:
            ValueError: The camera, which shows it, is elsewhere.
        """
        follows = self.lay in MOTION_LAYS
        if follows and self.camera_elsewhere:
            raise ValueError(
                f"lay {self.lay!r} is shown by the rig's own camera alone: camera_elsewhere must "
                "be false"
            )
        return follows

    def arm_path(self) -> ArmPath | None:
        """Return the way on which an arm carries the guide; None for a carriage.

        Raises:
            ValueError: The arm's file cannot be used, or the lay is known ahead for one free
                length and the arm's changes.
        """
        path = open_arm(self.machine_file, self.resolved())
        if path is not None and path.varies and not self.follows_commands:
            raise ValueError(
                f"lay {self.lay!r} is known ahead for one free length, that of the arm changes: "
                f"take lay {', '.join(MOTION_LAYS)}"
            )
        return path

    def laid(self, rng: np.random.Generator) -> CableLay:
        """Return where the cable will lie that the drive programme lays.

        A hidden cable is drawn first of all from rng.
        """
        what = self.resolved()
        end = what.drive.positions(self.duration)[0]
        if self.lay == PAPER:
            return published_lay(what.case, what.drive, what.free_length, end)
        return simulated_lay(what.case, what.drive, HiddenCable.drawn(rng), end)

    @property
    def frame_period(self) -> int:
        """Samples of the machine from one frame to the next.

        Raises:
            ValueError: The frame rate is neither 200 nor 1000 Hz.
        """
        if self.frame_rate not in (200, 1000):
            raise ValueError(f"frame_rate must be 200 or 1000 Hz, got {self.frame_rate}")
        return 1000 // self.frame_rate

    def command_limits(self, arm: ArmPath | None = None) -> CommandLimits:
        """Return what outside commanders may ask of the machine, and of its arm.

        Raises:
            ValueError: The carriage's travel or the brake's limits end before they begin.
        """
        if arm is None:
            low, high = self.carriage_travel
            speed, acceleration = self.carriage_speed_limit, self.carriage_acceleration_limit
        else:
            commands = arm.mapping.commands
            low, high = (arm.reach(end)[0] for end in (commands.low_m, commands.high_m))
            speed, acceleration = commands.speed_m_s, commands.acceleration_m_s2
        return CommandLimits(
            cylinder=replace(
                CYLINDER_LIMITS,
                speed=self.cylinder_speed_limit,
                acceleration=self.cylinder_acceleration_limit,
            ),
            carriage=replace(
                CARRIAGE_LIMITS, speed=speed, acceleration=acceleration, low=low, high=high
            ),
            low_tension=self.brake_limits[0],
            high_tension=self.brake_limits[1],
            brake_time=self.brake_time,
            timeout=self.command_timeout,
        )
