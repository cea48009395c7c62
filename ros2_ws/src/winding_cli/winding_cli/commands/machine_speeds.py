"""A run of the simulated machine's two axes, for the study's picture of the speeds."""

from __future__ import annotations

from dataclasses import dataclass

from winding_core.drive import DriveProfile
from winding_study.runs.run_record import Signal


@dataclass(frozen=True, kw_only=True)
class MachineSpeeds:
    """Measured and wanted speeds of both axes.

    Attributes:
        drive: The wanted speeds.
        cylinder_speed: Measured [rad/s].
        carriage_speed: Measured [m/s].
        cylinder_setpoint: Commanded [rad/s].
        carriage_setpoint: Commanded [m/s].
        end: Length of the run [s].
    """

    drive: DriveProfile
    cylinder_speed: Signal
    carriage_speed: Signal
    cylinder_setpoint: Signal
    carriage_setpoint: Signal
    end: float


def machine_speeds(case: int, duration: float) -> MachineSpeeds:
    """Drive the simulated machine through a run of a case of Table 1, without a graph."""
    import numpy as np

    from winding_core.cases import paper_case
    from winding_rig_node.machine.machine import SAMPLE_RATE, Machine, MachineConfig

    drive = DriveProfile()
    machine = Machine(
        MachineConfig(case=paper_case(case), drive=drive, duration=duration),
        np.random.default_rng(0),
    )
    machine.start()
    rows = []
    for _ in range(round(duration * SAMPLE_RATE)):
        machine.step()
        reading, wanted = machine.reading(), machine.setpoints()
        rows.append(
            (
                machine.time,
                reading.angular_speed,
                reading.feed_speed,
                wanted.angular_speed,
                wanted.feed_speed,
            )
        )
    t, *columns = np.array(rows).T
    cylinder, carriage, wanted_cylinder, wanted_carriage = (
        Signal(t=t, value=column) for column in columns
    )
    return MachineSpeeds(
        drive=drive,
        cylinder_speed=cylinder,
        carriage_speed=carriage,
        cylinder_setpoint=wanted_cylinder,
        carriage_setpoint=wanted_carriage,
        end=duration,
    )
