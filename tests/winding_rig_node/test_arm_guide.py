"""The guide on an arm in place of the carriage: it leads as one, and reports where it cannot."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arm_example import arm_file

from winding_core.arm.arm_path import ArmPath
from winding_core.arm.opening import open_arm
from winding_core.cable.condition import Condition
from winding_core.machine.readings import GuidePlace
from winding_rig_node.lay.driven_lay import DrivenLay
from winding_rig_node.lay.lay_on import HiddenRig
from winding_rig_node.machine.arm_guide import ArmGuide
from winding_rig_node.machine.faults import Faults, parse_faults
from winding_rig_node.machine.machine import Machine
from winding_rig_node.machine.machine_config import SENSORS, MachineConfig, Phase, cylinder_axis

WHAT = Condition(case=4, duration=4.0).resolved()
RHO, FREE = WHAT.case.centreline_radius, WHAT.free_length
# Most of the time a servo of 12 Hz is behind its plan by a hundredth of a second's way [m].
SERVO = 5.0e-5


def opened(file: str) -> ArmPath:
    path = open_arm(file, WHAT)
    assert path is not None
    return path


def machine(path: ArmPath | None, **config: Any) -> Machine:
    """Return a machine that has begun to wind case 4."""
    made = Machine(
        MachineConfig(
            case=WHAT.case,
            drive=WHAT.drive,
            duration=WHAT.duration,
            cylinder=cylinder_axis(WHAT.case),
            arm=None if path is None else ArmGuide(path),
            **config,
        ),
        np.random.default_rng(1),
    )
    made.start()
    return made


def run(made: Machine, samples: int) -> None:
    for _ in range(samples):
        made.step()


def place(made: Machine) -> GuidePlace:
    found = made.reading().guide
    assert found is not None
    return found


def test_arm_leads_the_guide_where_the_carriage_would(tmp_path: Path) -> None:
    led, slid = machine(opened(arm_file(tmp_path))), machine(None)
    for _ in range(8):
        run(led, 500)
        run(slid, 500)
        assert led.state.carriage.motor.position == pytest.approx(
            slid.state.carriage.motor.position, abs=SERVO
        )
        assert place(led).x == pytest.approx(RHO, abs=SERVO)
        assert place(led).y == pytest.approx(-FREE, abs=SERVO)
        # Both are judged by encoders; those of six joints add up to some micrometres.
        assert led.reading().carriage_position == pytest.approx(
            led.state.carriage.motor.position, abs=SERVO
        )
    assert led.state.phase is slid.state.phase is Phase.FINISHED


def test_joints_are_reported_where_the_eye_is(tmp_path: Path) -> None:
    path = opened(arm_file(tmp_path))
    led = machine(path)
    run(led, 2000)
    names, positions = led.arm_joints
    assert names == tuple(joint.name for joint in path.arm.joints)
    x, y, z = path.eye(np.array(positions))
    # The machine knows its eye linearly about a place a milliradian away: its square, in metres.
    assert (x, y) == pytest.approx((place(led).x, place(led).y), abs=1.0e-6)
    assert z == pytest.approx(led.reading().carriage_position, abs=2.0e-6)


def test_span_changes_along_the_way_as_the_file_has_it(tmp_path: Path) -> None:
    path = opened(arm_file(tmp_path, path={"along_m": [0.0, 0.015], "span_m": [FREE, 1.3 * FREE]}))
    led = machine(path)
    for _ in range(4):
        run(led, 1000)
        along = led.state.carriage.motor.position
        span = FREE * (1.0 + 0.3 * min(along / 0.015, 1.0))
        assert -place(led).y == pytest.approx(span, abs=20.0 * SERVO)
        assert place(led).x == pytest.approx(RHO, abs=20.0 * SERVO)


def test_guide_slows_where_a_joint_is_too_slow_and_the_machine_names_it(tmp_path: Path) -> None:
    path = opened(arm_file(tmp_path, joint_speed=0.01))
    led = machine(path)
    run(led, 3000)
    assert re.fullmatch(
        r"the guide is slowed to 0\.00\d+ m/s at 0\.00\d+ m: \w+_joint would exceed its largest "
        r"speed of 0\.01, as near a singularity",
        led.remark,
    )
    assert np.abs(led.state.arm.speeds).max() <= 0.01


def test_guide_stands_where_the_arm_reaches_no_further(tmp_path: Path) -> None:
    path = opened(arm_file(tmp_path))
    arm, state = ArmGuide(path), ArmGuide(path).at_start()
    eye = machine(path).state.carriage
    far = path.reach(2.0)[0]
    assert 0.2 < far < 2.0
    state.along = far - 0.01
    for along in np.linspace(0.0, state.along, 50):
        state.planned = path.joints_at(float(along), state.planned)
    for _ in range(1000):
        arm.control(state, eye, setpoint=0.05, acceleration=0.0, dt=0.002, open_loop=False)
    assert "the guide stands at" in state.remark
    # The reach is looked at every 5 mm.
    assert state.along == pytest.approx(far, abs=6.0e-3)


@pytest.mark.parametrize(
    ("stop", "phase"),
    [
        (Machine.stop, Phase.IDLE),
        (Machine.quick_stop, Phase.IDLE),
        (Machine.emergency_stop, Phase.EMERGENCY),
        (lambda made: made.protect("as a test wants"), Phase.PROTECTIVE),
    ],
)
def test_every_stop_brings_the_arm_to_rest(tmp_path: Path, stop: Any, phase: Phase) -> None:
    led = machine(opened(arm_file(tmp_path)))
    run(led, 1500)
    stop(led)
    run(led, 3000)
    assert not led.moving
    assert led.state.phase is phase
    assert all(joint.motor.speed == 0.0 for joint in led.state.arm.joints)
    led.reset()
    assert led.reading().carriage_position == 0.0
    assert led.state.phase is Phase.IDLE


def test_encoders_that_count_wrongly_stop_an_arm_as_a_carriage(tmp_path: Path) -> None:
    led = machine(opened(arm_file(tmp_path)))
    led.faults = Faults(parse_faults("carriage_encoder:stuck", SENSORS))
    run(led, 3000)
    assert led.state.phase is Phase.PROTECTIVE
    assert "carriage encoder" in led.state.reason


HIDDEN = HiddenRig(free_length=0.19, load_share=0.7, drag=0.1, guide_play=0.0, bending=0.0)


def test_lay_of_a_guide_that_keeps_its_place_is_that_of_a_carriage() -> None:
    led, slid = DrivenLay(WHAT.case, HIDDEN), DrivenLay(WHAT.case, HIDDEN)
    for angle in np.arange(0.0, 12.0, 0.002).tolist():
        led.advance(angle, 2.0e-3 * angle, 1.96, GuidePlace.beside(RHO, FREE))
        slid.advance(angle, 2.0e-3 * angle, 1.96)
    theta = np.linspace(0.5, 11.5, 20)
    # Rounding, over six thousand steps.
    assert led.z_at(theta) == pytest.approx(slid.z_at(theta), abs=1.0e-12)


def test_cable_follows_a_span_that_grows_by_the_law_of_its_slope() -> None:
    led, step, grown = DrivenLay(WHAT.case, HIDDEN), 5.0e-4, 0.005
    z, wanted = 0.0, []
    for angle in np.arange(0.0, 12.0, step).tolist():
        guide = GuidePlace.beside(RHO, FREE + grown * angle)
        led.advance(angle, 2.0e-3 * angle, 1.96, guide)
        # Hidden is how much shorter it is throughout; z + L / rho dz/dtheta = eye.
        span = HIDDEN.free_length + grown * angle
        z += step * (2.0e-3 * angle - z) * RHO / span
        wanted.append(z)
    # Euler's error is half a step of z'' over the lag, which is a micrometre.
    assert led.z == pytest.approx(wanted[-1], abs=2.0e-6)


def test_hidden_span_begins_as_drawn_whatever_the_arm_reports() -> None:
    lay = DrivenLay(WHAT.case, replace(HIDDEN, free_length=0.21))
    lay.advance(0.0, 0.0, 1.96, GuidePlace.beside(RHO, FREE))
    assert lay.view().free_length == pytest.approx(0.21, abs=1.0e-12)
