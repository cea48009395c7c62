"""What the machine is: rates, axes, sensors and their limits; its state and the phases of a run."""

import math
from dataclasses import dataclass, field, replace
from enum import Enum

from winding_core.cable.cases import Case
from winding_core.machine.drive import PAPER_FEED_SPEED, DriveProfile
from winding_rig_node.machine.arm_guide import ArmGuide, ArmState
from winding_rig_node.machine.axis import (
    CARRIAGE_ENCODER,
    CARRIAGE_MOTOR,
    CYLINDER_ENCODER,
    CYLINDER_MOTOR,
    AxisConfig,
    AxisState,
    tuned_pid,
)
from winding_rig_node.machine.commander import CommandLimits
from winding_rig_node.machine.plausibility import AxisLimits, PlausibilityConfig

SAMPLE_RATE = 1000
CONTROL_RATE = 500
FORCE_RATE = 100
_LOOP_BANDWIDTH = 4.0
CYLINDER_ENCODER_SIGNAL, CARRIAGE_ENCODER_SIGNAL = "cylinder_encoder", "carriage_encoder"
LOAD_CELL_SIGNAL = "load_cell"
SENSORS = (CYLINDER_ENCODER_SIGNAL, CARRIAGE_ENCODER_SIGNAL, LOAD_CELL_SIGNAL)

CYLINDER_AXIS = AxisConfig(
    motor=CYLINDER_MOTOR, encoder=CYLINDER_ENCODER, pid=tuned_pid(CYLINDER_MOTOR, _LOOP_BANDWIDTH)
)
CARRIAGE_AXIS = AxisConfig(
    motor=CARRIAGE_MOTOR, encoder=CARRIAGE_ENCODER, pid=tuned_pid(CARRIAGE_MOTOR, _LOOP_BANDWIDTH)
)


# Load up to which the paper's motor holds its speed as in the paper's cases, which take half of it
# at most [N m].
_RATED = 0.25


def cylinder_axis(case: Case) -> AxisConfig:
    """Return the rotating axis of a rig for a cable: the paper's, or one as much stronger."""
    load = case.weight * case.centreline_radius
    motor = CYLINDER_AXIS.motor.times(max(load / _RATED, 1.0))
    return replace(CYLINDER_AXIS, motor=motor)


@dataclass(frozen=True, kw_only=True)
class MachineConfig:
    """The machine and its load."""

    case: Case  # What is wound
    drive: DriveProfile  # Target speeds
    duration: float  # Of the drive programme, after which a run is finished [s]
    cylinder: AxisConfig = CYLINDER_AXIS  # Rotating axis, see `cylinder_axis`
    carriage: AxisConfig = CARRIAGE_AXIS  # Traversing axis
    arm: ArmGuide | None = None  # What carries the guide in its place
    force_noise: float = 0.01  # One standard deviation of the load cell [N]
    force_resolution: float = 0.001  # Step of its converter [N]
    # How long the encoders go on after a quick or protective stop [s], so that the readers see the
    # machine stand.
    settling_time: float = 0.1
    # Time from full speed to standstill in a quick or protective stop [s].
    quick_stop_time: float = 0.3
    # What outside commanders may ask for.
    commands: CommandLimits = field(default_factory=CommandLimits)


def sensor_limits(
    config: MachineConfig, full_speeds: tuple[float, ...] | None = None
) -> PlausibilityConfig:
    """Return the limits of a machine's sensors.

    Args:
        config: The machine.
        full_speeds: Of cylinder and carriage [rad/s, m/s]; those of the drive programme by default.
    """
    cylinder, carriage = full_speeds or (config.drive.angular_speed, config.drive.feed_speed)
    # A carriage that stands is judged as one of the paper's speed.
    carriage = abs(carriage) or PAPER_FEED_SPEED
    return PlausibilityConfig(
        axes=(
            AxisLimits(
                name="cylinder",
                full_speed=cylinder,
                resolution=config.cylinder.encoder.resolution,
                cogging=config.cylinder.motor.cogging_speed,
            ),
            AxisLimits(
                name="carriage",
                full_speed=carriage,
                resolution=config.carriage.encoder.resolution,
                cogging=config.carriage.motor.cogging_speed,
            ),
        ),
        weight=config.case.weight,
        # Without noise a healthy load cell repeats one value for ever.
        still_tension=0.3 if config.force_noise > config.force_resolution else math.inf,
    )


class Phase(Enum):
    """What the machine is doing."""

    IDLE = "idle"
    WINDING = "winding"
    STOPPING = "stopping"
    FINISHED = "finished"
    PROTECTIVE = "protective stop"
    EMERGENCY = "emergency stop"


class PhaseError(ValueError):
    """The machine cannot do this in its present phase."""


@dataclass(kw_only=True)
class MachineState:
    """Everything that changes."""

    phase: Phase = Phase.IDLE  # What the machine does
    sample: int = 0  # Number of encoder samples since the machine was switched on
    drive_sample: int = 0  # Samples of the current run, the ramps of stops and starts included
    fraction: float = 0.0  # Share of full speed that the setpoints ask for
    fraction_rate: float = 0.0  # Its change per second [1/s]
    full_speed_time: float = 0.0  # Time at full speed that covers the commanded way so far [s]
    stopped: bool = False  # Whether the run has been stopped and resumed, or is to be
    quick: bool = False  # Whether the present stop is a quick one
    reason: str = ""  # Why the machine was stopped, where no stop was requested
    stop_began: float | None = None  # When the last unplanned stop began, simulated time [s]
    stood_at: float | None = None  # When both axes stood after it [s]
    tension: float | None = None  # Last load cell sample [N]; None when it was invalid
    # Where the drive programme's way begins, by axis, once the axis was commanded.
    origins: dict[str, float] = field(default_factory=dict)
    cylinder: AxisState = field(default_factory=AxisState)  # Its axis, in radians
    carriage: AxisState = field(default_factory=AxisState)  # Its axis, or the arm's eye, in metres
    arm: ArmState | None = None  # What carries the eye; None for a carriage

    @property
    def time(self) -> float:
        """Simulated time since the machine was switched on [s]."""
        return self.sample / SAMPLE_RATE
