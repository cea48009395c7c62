"""A simulated machine, what winds it, and the commands that tests give it."""

import math

import numpy as np

from winding_core.cable.cases import paper_case
from winding_core.machine.commands import AxisTarget, JointTargets, JointTrajectory, Waypoint
from winding_core.machine.drive import DriveProfile
from winding_rig_node.machine.machine import Machine
from winding_rig_node.machine.machine_config import MachineConfig

BEGIN = 1.0  # A machine has wound for so long before it is commanded [s]


def machine(case: int = 4, duration: float = 60.0, seed: int = 1) -> Machine:
    config = MachineConfig(case=paper_case(case), drive=DriveProfile(), duration=duration)
    return Machine(config, np.random.default_rng(seed))


def winding(duration: float = 60.0, until: float = BEGIN) -> Machine:
    """Return a machine that has wound up to a time [s]."""
    rig = machine(duration=duration)
    rig.start()
    run(rig, until)
    return rig


def run(rig: Machine, seconds: float = math.inf) -> None:
    """Step a machine on for a time [s], or until it stands."""
    end = rig.time + seconds - 0.5e-3
    while rig.moving and rig.time < end:
        rig.step()


# A sine of the carriage: amplitude [m], frequency [Hz], and what it may be missed by [m].
AMPLITUDE = 20.0e-3
FREQUENCY = 0.5
MISSED = 0.5e-3
OMEGA = 2.0 * math.pi * FREQUENCY


def sine(t: float) -> float:
    return AMPLITUDE * math.sin(OMEGA * t)


def sine_speed(t: float) -> float:
    return AMPLITUDE * OMEGA * math.sin(OMEGA * t)


def from_rest(t: float) -> float:
    """A sine that begins at its turning point: who commands speeds cannot catch up."""
    return AMPLITUDE * (1.0 - math.cos(OMEGA * t))


def targets(t: float = 0.0, **axes: AxisTarget) -> JointTargets:
    return JointTargets(t=t, axes=axes)


def guide(**target: float) -> JointTargets:
    """Return a target of the carriage that holds now."""
    return targets(carriage=AxisTarget(**target))


def course(*points: tuple[float, ...], t: float = 0.0) -> JointTrajectory:
    waypoints = tuple(
        Waypoint(t=point[0], position=point[1], speed=point[2] if len(point) > 2 else None)
        for point in points
    )
    return JointTrajectory(t=t, axes={"carriage": waypoints})


def carriage(rig: Machine) -> float:
    return rig.state.carriage.motor.position
