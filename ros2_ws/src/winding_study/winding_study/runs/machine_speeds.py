"""A run of the simulated machine's two axes, for the study's picture of the speeds."""

from __future__ import annotations

from winding_core.cases import paper_case
from winding_core.drive import DriveProfile
from winding_rig_node.machine.machine import axis_trial
from winding_rig_node.machine.machine_config import MachineConfig
from winding_study.runs.run_record import AxisSpeeds, Signal


def machine_speeds(case: int, duration: float) -> AxisSpeeds:
    """Drive the simulated machine through a run [s] of a case of Table 1, without a graph."""
    drive = DriveProfile()
    config = MachineConfig(case=paper_case(case), drive=drive, duration=duration)
    t, _, cylinder, _, carriage, _, wanted_cylinder, _, wanted_carriage = axis_trial(config).T
    return AxisSpeeds(
        drive=drive,
        cylinder_speed=Signal(t=t, value=cylinder),
        carriage_speed=Signal(t=t, value=carriage),
        cylinder_setpoint=Signal(t=t, value=wanted_cylinder),
        carriage_setpoint=Signal(t=t, value=wanted_carriage),
    )
