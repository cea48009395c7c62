"""The machine judges its sensors: what cannot be is refused, what lasts stops it, and it stands."""

import math

import numpy as np
import pytest

from winding_core.cases import paper_case
from winding_core.drive import DriveProfile
from winding_rig_node.machine.faults import Faults, parse_faults
from winding_rig_node.machine.machine import Machine
from winding_rig_node.machine.machine_config import SENSORS, MachineConfig, Phase, PhaseError

FULL_SPEED = DriveProfile().angular_speed
# A stop takes 0.3 s from full speed; the bar of the fault table is 0.5 s.
STAND_WITHIN = 0.5


def machine(case: int = 4, duration: float = 3.0) -> Machine:
    config = MachineConfig(case=paper_case(case), drive=DriveProfile(), duration=duration)
    return Machine(config, np.random.default_rng(1))


def break_at(t: float, text: str) -> tuple[Machine, float]:
    """Wind with a fault from t [s] on until the machine stands; return it and the largest speed."""
    rig = machine()
    rig.start()
    fastest = 0.0
    while rig.moving:
        if rig.time >= t and not rig.faults:
            rig.faults = Faults(parse_faults(text, SENSORS))
        rig.step()
        fastest = max(fastest, abs(rig.state.cylinder.motor.speed))
    return rig, fastest


@pytest.mark.slow
def test_healthy_machine_of_every_case_winds_to_its_end() -> None:
    offenders = []
    for case in range(1, 13):
        rig = machine(case, duration=2.5)
        rig.start()
        while rig.moving:
            rig.step()
            if rig.state.drive_sample == 2000:
                rig.stop()
        ended = rig.state.phase in (Phase.FINISHED, Phase.IDLE)
        if not ended or rig.plausibility.refused:
            offenders.append((case, rig.state.phase, rig.plausibility.refused))
    assert offenders == []


IMPOSSIBLE = {
    "cylinder_encoder:off": "cylinder encoder gives no valid reading",
    "cylinder_encoder:stuck": "cylinder encoder is stuck",
    "cylinder_encoder:garbage": "cylinder encoder gives no valid reading",
    "cylinder_encoder:wrong:-1": "cylinder encoder",
    "cylinder_encoder:wrong:0.5": "cylinder encoder",
    "carriage_encoder:stuck": "carriage encoder",
    "carriage_encoder:wrong:-1": "carriage encoder",
    "load_cell:off": "load cell gives no valid reading",
    "load_cell:garbage": "load cell gives no valid reading",
    "load_cell:stuck": "load cell is stuck",
    "load_cell:wrong:0.1": "tension is outside",
    "load_cell:wrong:5": "tension is outside",
}


@pytest.mark.slow
@pytest.mark.parametrize("t", [0.0, 1.5], ids=["from the start", "at full speed"])
def test_sensor_that_cannot_be_right_ends_in_standstill(t: float) -> None:
    offenders = []
    for text, sentence in IMPOSSIBLE.items():
        rig, fastest = break_at(t, text)
        state = rig.state
        began, stood = state.stop_began or math.nan, state.stood_at or math.nan
        still = state.cylinder.motor.speed == state.carriage.motor.speed == 0.0
        # The controller pushes for the 50 ms in which nobody knows.
        if not (
            state.phase is Phase.PROTECTIVE
            and sentence in state.reason
            and stood - began <= STAND_WITHIN
            and still
            and fastest < 2.0 * FULL_SPEED
        ):
            offenders.append((text, fastest, state))
    assert offenders == []


def test_fault_is_judged_after_fifty_milliseconds() -> None:
    rig, _ = break_at(1.5, "cylinder_encoder:off")
    assert rig.state.stop_began is not None
    # One control step late at most.
    assert rig.state.stop_began - 1.5 == pytest.approx(0.05, abs=0.003)


def test_single_lost_samples_do_not_stop_the_machine() -> None:
    rig, _ = break_at(1.0, "cylinder_encoder:intermittent:0.2,load_cell:intermittent:0.2")
    assert rig.state.phase is Phase.FINISHED


def test_protective_stop_is_latched_until_reset() -> None:
    rig, _ = break_at(1.5, "load_cell:off")
    with pytest.raises(PhaseError, match="cannot start while the machine is in protective stop"):
        rig.start()
    rig.faults = Faults()
    rig.reset()
    rig.start()
    while rig.moving:
        rig.step()
    assert rig.state.phase is Phase.FINISHED


def test_emergency_stop_is_latched_until_reset() -> None:
    rig = machine()
    rig.start()
    for _ in range(1500):
        rig.step()
    rig.emergency_stop()
    while rig.moving:
        rig.step()
    for act in (rig.start, rig.stop):
        with pytest.raises(PhaseError, match="in emergency stop"):
            act()
    rig.quick_stop()
    assert rig.state.phase is Phase.EMERGENCY
    rig.reset()
    rig.start()
    assert rig.state.phase is Phase.WINDING


def test_quick_stop_is_resumed_by_start() -> None:
    rig = machine()
    rig.start()
    while rig.time < 1.5:
        rig.step()
    rig.quick_stop("told to")
    began = rig.time
    while rig.moving:
        rig.step()
    assert rig.state.phase is Phase.IDLE
    assert rig.state.stood_at is not None
    assert rig.state.stood_at - began <= STAND_WITHIN
    stood = rig.state.cylinder.motor.position
    rig.start()
    assert rig.state.reason == ""
    while rig.moving:
        rig.step()
    assert rig.state.phase is Phase.FINISHED
    assert rig.state.cylinder.motor.position > stood


def test_value_that_cannot_be_never_reaches_controller_or_reader() -> None:
    rig = machine()
    rig.start()
    while rig.time < 1.0:
        rig.step()
    rig.faults = Faults(parse_faults("cylinder_encoder:garbage,load_cell:garbage", SENSORS))
    while rig.moving:
        rig.step()
        reading = rig.reading()
        assert math.isfinite(reading.cylinder_angle)
        assert math.isfinite(reading.angular_speed)
        assert rig.state.tension is None or math.isfinite(rig.state.tension)
    assert rig.plausibility.refused["cylinder encoder"] > 0
    assert rig.plausibility.refused["load cell"] > 0
