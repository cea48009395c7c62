"""What changes on the machine, and the phases of a run."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from winding_rig_node.machine.axis import AxisState
from winding_rig_node.machine.machine_config import SAMPLE_RATE


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
    """Everything that changes.

    Attributes:
        phase: What the machine does.
        sample: Number of encoder samples since the machine was switched on.
        drive_sample: Samples of the current run, the ramps of stops and starts included.
        fraction: Share of full speed that the setpoints ask for.
        fraction_rate: Its change per second [1/s].
        full_speed_time: Time at full speed that covers the commanded way so far [s].
        quick: Whether the present stop is a quick one.
        reason: Why the machine was stopped, if nobody asked for it.
        stop_began: When the last unplanned stop began, simulated time [s].
        stood_at: When both axes stood after it [s].
        tension: Last load cell sample [N]; None when it said nothing that can be.
        origins: Where the drive programme's way begins, by axis, once the axis was commanded.
        cylinder: Its axis, in radians.
        carriage: Its axis, in metres.
    """

    phase: Phase = Phase.IDLE
    sample: int = 0
    drive_sample: int = 0
    fraction: float = 0.0
    fraction_rate: float = 0.0
    full_speed_time: float = 0.0
    quick: bool = False
    reason: str = ""
    stop_began: float | None = None
    stood_at: float | None = None
    tension: float | None = None
    origins: dict[str, float] = field(default_factory=dict)
    cylinder: AxisState = field(default_factory=AxisState)
    carriage: AxisState = field(default_factory=AxisState)

    @property
    def time(self) -> float:
        """Simulated time since the machine was switched on [s]."""
        return self.sample / SAMPLE_RATE
