"""What the lay controller answers to encoded messages: commands in the joint's own unit, modes."""

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from axis_readings import axis_reading

from lay_control_node.ros.message_handler import Clocks, LayControlHandler
from lay_control_node.ros.parameters import LayControlParameters
from processes import python
from winding_core.lay.records import LAY_CONTROL_DTYPE, LAY_DTYPE, ControlBasis, ControlMode
from winding_core.machine.axes import MachineAxes
from winding_core.machine.readings import AxisReading, GuidePlace
from winding_core.markers import MARKER_DTYPE
from winding_ros import topics
from winding_ros.messages.clouds import decode_cloud, encode_cloud
from winding_ros.messages.rig import encode_joint_state, encode_tension
from winding_ros.messages.serialised import MessageError

PERIOD = 1.0e-3
COMMANDS_PERIOD = 0.02
# Joints of a carriage that counts millimetres, backwards, and stands at 1234.5 at the start.
AXES: dict[str, Any] = {"carriage_scale": -1.0e-3, "carriage_offset": 1234.5}
DRIVE = LayControlParameters().resolved().drive


class Clock:
    """Time of a test [s], and when the message arrived where that is another."""

    def __init__(self) -> None:
        self.now, self.arrived = 1000.0, 0.0

    def __call__(self) -> float:
        return self.now


def begun(clock: Clock | None = None, **parameters: Any) -> LayControlHandler:
    wanted = LayControlParameters(**{"control": "drive", **parameters})
    clocks = clock and Clocks(now=clock, arrived=lambda: clock.arrived or clock.now)
    handler = LayControlHandler(wanted, clocks)
    list(handler.begin(0.0))
    return handler


def joint_state(t: float, reading: AxisReading, **axes: Any) -> bytes:
    """Return the message of a machine whose joints have scales and offsets of their own."""
    machine = MachineAxes(**axes)
    return encode_joint_state(
        t,
        axis_reading(
            reading.cylinder_angle / machine.cylinder_scale + machine.cylinder_offset,
            reading.carriage_position / machine.carriage_scale + machine.carriage_offset,
            speed=reading.angular_speed / machine.cylinder_scale,
            feed=reading.feed_speed / machine.carriage_scale,
        ),
    )


def instants(start: float, end: float) -> Iterable[float]:
    return (start + PERIOD * k for k in range(round((end - start) / PERIOD)))


def wind(
    handler: LayControlHandler, start: float, end: float, *, solver: bool = True, **axes: Any
) -> list[Any]:
    """Give a handler the drive programme's joint states; return what it answers."""
    answers = []
    for t in instants(start, end):
        if solver:
            assert not list(
                handler.take(topics.FEM_MARKERS, encode_cloud(t, np.zeros(0, dtype=MARKER_DTYPE)))
            )
        answers += handler.take(topics.JOINT_STATES, joint_state(t, DRIVE.reading_at(t), **axes))
    return answers


def on(topic: Any, answers: Iterable[Any]) -> list[Any]:
    return [answer.message for answer in answers if answer.topic is topic]


def commanded(answers: Iterable[Any]) -> list[Any]:
    return on(topics.JOINT_TARGETS, answers)


def states(answers: Iterable[Any]) -> np.ndarray:
    """Return the records of lay_control/state."""
    clouds = [
        decode_cloud(message, LAY_CONTROL_DTYPE)[1]
        for message in on(topics.LAY_CONTROL_STATE, answers)
    ]
    return np.concatenate(clouds)


def test_targets_are_in_the_joints_own_unit_sign_and_offset() -> None:
    plain = wind(begun(), 0.0, 1.0)
    targets = commanded(wind(begun(**AXES), 0.0, 1.0, **AXES))
    assert len(targets) == len(commanded(plain)) == round(1.0 / COMMANDS_PERIOD)
    for mine, his in zip(commanded(plain), targets, strict=True):
        # Rounding of 1234.5 mm in double precision, and of what was computed with it.
        assert his.position[0] == pytest.approx(1234.5 - 1.0e3 * mine.position[0], abs=1.0e-7)
        assert his.velocity[0] == pytest.approx(-1.0e3 * mine.velocity[0], abs=1.0e-6)
    assert targets[-1].position[0] < 1234.5


def test_a_command_at_time_zero_has_a_stamp() -> None:
    (first,) = commanded(wind(begun(), 0.0, PERIOD))
    assert (first.header.stamp.sec, first.header.stamp.nanosec) == (0, 1)


def test_target_names_the_machines_own_joint_and_no_other() -> None:
    handler = begun(carriage_joint="carriage_joint", cylinder_joint="cylinder_joint")
    names = {tuple(target.name) for target in commanded(wind(handler, 0.0, 0.1))}
    assert names == {("carriage_joint",)}


def test_state_is_published_at_its_rate_whatever_the_encoders_rate() -> None:
    answers = wind(begun(), 0.0, 1.0)
    assert len(on(topics.LAY_CONTROL_STATE, answers)) == round(1.0 / COMMANDS_PERIOD)


@pytest.mark.parametrize("mode", ["off", "watch"])
def test_nothing_is_commanded_by_a_controller_that_does_not_drive(mode: str) -> None:
    answers = wind(begun(control=mode, brake=True, markers_every_turn=True), 0.0, 1.0)
    assert {answer.topic for answer in answers} == {topics.LAY_CONTROL_STATE}
    assert set(states(answers)["mode"]) == {int(ControlMode[mode.upper()])}


def test_pull_is_commanded_of_a_machine_with_a_brake_alone() -> None:
    with_brake = wind(begun(brake=True, markers_every_turn=True), 0.0, 1.0)
    assert on(topics.TENSION_COMMAND, with_brake)
    assert not on(topics.TENSION_COMMAND, wind(begun(), 0.0, 1.0))


def stood_still(handler: LayControlHandler, start: float, end: float) -> list[Any]:
    """Give a handler joint states of a machine that stopped at an instant [s], till another."""
    standing = replace(DRIVE.reading_at(start), angular_speed=0.0, feed_speed=0.0)
    answers: list[Any] = []
    for t in instants(start, end):
        answers += handler.take(topics.JOINT_STATES, encode_joint_state(t, standing))
    return answers


def test_machine_that_stands_after_a_stop_is_not_commanded() -> None:
    handler = begun()
    wind(handler, 0.0, 2.0)
    stood_still(handler, 2.0, 2.3)
    later = stood_still(handler, 2.3, 3.0)
    assert commanded(later) == []
    assert len(on(topics.LAY_CONTROL_STATE, later)) == round(0.7 / COMMANDS_PERIOD)


def test_controller_that_starts_beside_a_standing_machine_soon_leaves_it_alone() -> None:
    handler = begun()
    stood_still(handler, 2.0, 2.3)
    assert commanded(stood_still(handler, 2.3, 3.0)) == []


def test_restart_in_mid_run_takes_the_guide_over_where_it_is() -> None:
    targets = commanded(wind(begun(), 5.0, 6.0))
    guide = [target.position[0] for target in targets]
    first = DRIVE.reading_at(5.0)
    # Within the first period a carriage moves no further than at its largest speed.
    limit = LayControlParameters().guide_speed_limit * COMMANDS_PERIOD
    assert abs(guide[0] - first.carriage_position) < limit
    acceleration = LayControlParameters().guide_acceleration_limit
    # Second differences of places that follow one another at the acceleration's limit.
    assert np.abs(np.diff(guide, 2)).max() <= acceleration * COMMANDS_PERIOD**2 * (1.0 + 1.0e-6)


def test_restart_beside_a_guide_that_is_where_it_should_be_leaves_it_there() -> None:
    handler = begun()
    what = LayControlParameters().resolved()
    pitch = DRIVE.pitch / (2.0 * math.pi)
    lead = pitch * what.free_length / what.case.centreline_radius
    answers: list[Any] = []
    for t in instants(5.0, 6.0):
        reading = DRIVE.reading_at(t)
        ahead = replace(reading, carriage_position=pitch * reading.cylinder_angle + lead)
        answers += handler.take(topics.JOINT_STATES, encode_joint_state(t, ahead))
    targets = commanded(answers)
    # The last command is of 5.98 s. The end of the span grows 4 % less bent as the tension builds
    # up; the lay moves by 0.02 mm with it, and the law moves the guide by 11 times that.
    there = pitch * DRIVE.reading_at(5.98).cylinder_angle + lead
    assert targets[-1].position[0] == pytest.approx(there, abs=4.0e-4)


def test_restart_in_mid_run_owns_that_it_knows_little_of_the_lay() -> None:
    state = states(wind(begun(), 5.0, 5.1))
    assert state["sigma_z"][0] > 0.01
    assert state["theta"][0] == pytest.approx(DRIVE.reading_at(5.0).cylinder_angle)


def test_modes_are_switched_without_a_step_of_the_guide() -> None:
    handler = begun(control="watch")
    wind(handler, 0.0, 3.0)
    handler.switch(ControlMode.DRIVE)
    targets = commanded(wind(handler, 3.0, 3.5))
    guide = np.array([target.position[0] for target in targets])
    assert guide.size == round(0.5 / COMMANDS_PERIOD)
    limits = LayControlParameters()
    there = DRIVE.reading_at(3.0).carriage_position
    assert abs(guide[0] - there) < limits.guide_speed_limit * COMMANDS_PERIOD
    # Rounding of places of some 10 mm.
    step = limits.guide_speed_limit * COMMANDS_PERIOD * (1.0 + 1.0e-9)
    assert np.abs(np.diff(guide)).max() <= step


@pytest.mark.parametrize("mode", [ControlMode.OFF, ControlMode.WATCH])
def test_a_carriage_that_was_driven_goes_on_by_the_drive_programme(mode: ControlMode) -> None:
    handler = begun()
    before = commanded(wind(handler, 0.0, 3.0))[-1]
    handler.switch(mode)
    answers = wind(handler, 3.0, 5.0)
    targets = commanded(answers)
    guide = np.array([before.position[0], *(target.position[0] for target in targets)])
    speed = np.array([before.velocity[0], *(target.velocity[0] for target in targets)])
    limits = LayControlParameters()
    # Rounding of speeds of some 10 mm/s.
    most = limits.guide_acceleration_limit * COMMANDS_PERIOD * (1.0 + 1.0e-6)
    assert np.abs(np.diff(speed)).max() <= most
    assert np.abs(np.diff(guide)).max() <= limits.guide_speed_limit * COMMANDS_PERIOD
    assert speed[-1] == pytest.approx(DRIVE.reading_at(4.9).feed_speed, rel=0.01)
    assert set(states(answers)["basis"]) == {ControlBasis.RAMP}
    # Within the 0.2 s after which a machine counts as standing there are some.
    assert not commanded(stood_still(handler, 5.0, 6.0)[-30:])


def test_mode_that_was_switched_stays_in_the_next_run() -> None:
    handler = begun(control="watch")
    handler.switch(ControlMode.DRIVE)
    list(handler.begin(0.0))
    assert commanded(wind(handler, 0.0, 0.1))


def test_silent_solver_leaves_the_drive_programme() -> None:
    state = states(wind(begun(solver_patience=0.5), 0.0, 1.5, solver=False))
    assert state["basis"][0] != ControlBasis.RAMP
    assert state["basis"][-1] == ControlBasis.RAMP
    programme = DRIVE.reading_at(1.4).feed_speed
    # The setpoint goes at the feed speed of the drive programme, by the encoder.
    assert state["guide_speed"][-1] == pytest.approx(programme, rel=0.01)


def test_measured_lay_makes_the_estimate_surer() -> None:
    handler = begun()
    before = states(wind(handler, 0.0, 4.0))[-1]
    angle = DRIVE.reading_at(4.0).cylinder_angle
    places = np.zeros(20, dtype=LAY_DTYPE)
    places["theta"] = np.linspace(0.2, angle - 0.5, 20)
    places["z"] = before["z"] * places["theta"] / angle
    places["sigma_z"] = 1.0e-4
    assert list(handler.take(topics.TRACKED_LAY, encode_cloud(4.0, places))) == []
    after = states(wind(handler, 4.0, 4.1))[-1]
    assert after["sigma_free_length"] < before["sigma_free_length"]
    assert after["basis"] == ControlBasis.MEASURED


def in_step(handler: LayControlHandler, clock: Clock, start: float, end: float) -> list[Any]:
    """Wind with a clock that goes with the machine; return the answers."""
    answers = []
    for t in instants(start, end):
        clock.now = 1000.0 + t
        answers += wind(handler, t, t + PERIOD)
    return answers


@pytest.mark.parametrize(("gap", "late"), [(0.18, False), (0.26, True), (0.9, True)])
def test_late_commands_follow_the_drive_programme_until_they_are_in_time_again(gap, late):
    clock = Clock()
    handler = begun(clock)
    in_step(handler, clock, 2.7, 3.0)
    assert handler.cadence.largest == pytest.approx(COMMANDS_PERIOD)
    # The node gets no processor; what has waited is dealt with at once.
    clock.now += gap
    waited = []
    for t in instants(3.0, 3.0 + gap):
        clock.arrived = 1000.0 + t
        waited += wind(handler, t, t + PERIOD)
    clock.arrived = 0.0
    assert handler.cadence.largest == pytest.approx(gap, abs=COMMANDS_PERIOD)
    assert (set(states(waited)["basis"]) == {ControlBasis.LATE}) is late
    # The machine's own readings came in time.
    assert handler.cadence.largest_of_readings == pytest.approx(PERIOD)
    assert handler.cadence.unplanned == pytest.approx(gap, abs=COMMANDS_PERIOD)
    on_time = states(in_step(handler, clock, 3.0 + gap, 5.1 + gap))
    if late:
        programme = DRIVE.advance_per_radian * DRIVE.reading_at(4.9).angular_speed
        then = on_time[on_time["basis"] == ControlBasis.LATE]
        assert then["guide_speed"][-1] == pytest.approx(programme, rel=0.01)
    assert on_time["basis"][-1] != ControlBasis.LATE
    assert handler.cadence.largest == pytest.approx(gap, abs=COMMANDS_PERIOD)


def test_a_machine_whose_readings_stay_away_is_commanded_on_for_a_second():
    clock = Clock()
    handler = begun(clock, **AXES)
    before = []
    for t in instants(2.7, 3.0):
        clock.now = 1000.0 + t
        before += wind(handler, t, t + PERIOD, **AXES)
        assert not list(handler.carried(clock.now))
    last, begin = commanded(before)[-1], clock.now
    carried = []
    while clock.now < begin + 1.4:
        clock.now += 0.01
        carried += [(clock.now, message) for message in commanded(handler.carried(clock.now))]
    sent = np.array([begin, *(now for now, _ in carried)])
    # 20 Hz and more; what stays away for longer is for the machine to deal with.
    assert np.diff(sent).max() < 0.05
    assert 0.95 < sent[-1] - begin < 1.01
    programme = DRIVE.reading_at(2.9).feed_speed / AXES["carriage_scale"]
    place = last
    for now, message in carried:
        assert message.name == last.name
        ahead = now - begin + t - seconds(last)
        assert seconds(message) - seconds(last) == pytest.approx(ahead, abs=1.0e-6)
        # At its own rate for as long as a gap may be, then at that of the drive programme.
        blind = ahead > 0.2
        rate = programme if blind else last.velocity[0]
        assert message.velocity[0] == pytest.approx(rate, rel=1.0e-6)
        step = message.position[0] - place.position[0]
        slow, fast = sorted((abs(programme), abs(last.velocity[0])))
        dt = seconds(message) - seconds(place)
        assert slow * dt - 1.0e-6 <= abs(step) <= fast * dt + 1.0e-6
        place = message
    assert handler.cadence.unplanned == pytest.approx(0.02, abs=0.01)
    # A machine in arrears makes up for it at a third of the clock's pace.
    held, largest = carried[-1][1], 0.0
    for t in instants(3.0, 4.1):
        clock.now += 3.0 * PERIOD
        late = commanded(wind(handler, t, t + PERIOD, **AXES))
        largest = max(largest, handler.cadence.since(clock.now))
        for message in late:
            assert seconds(message) >= seconds(held)
            if t < seconds(held):
                assert message.position == held.position
                assert message.velocity[0] == 0.0
            held = message
    assert largest < 0.1
    assert seconds(held) == pytest.approx(4.1, abs=2.0 * COMMANDS_PERIOD)
    assert handler.cadence.unplanned == pytest.approx(1.4, abs=0.05)
    assert handler.cadence.largest == pytest.approx(0.42, abs=0.05)


def seconds(message: Any) -> float:
    return message.header.stamp.sec + 1.0e-9 * message.header.stamp.nanosec


def test_a_reading_that_is_missing_is_the_machines_gap():
    handler = begun()
    wind(handler, 2.8, 3.0)
    wind(handler, 3.33, 3.4)
    assert handler.cadence.largest_of_readings == pytest.approx(0.33, abs=2.0 * PERIOD)
    # Up to a period passes from a command to the next reading.
    assert 0.33 < handler.cadence.largest < 0.33 + 1.1 * COMMANDS_PERIOD


def test_a_machine_that_is_still_to_be_started_is_not_commanded():
    handler = begun(await_motion=True)
    assert not commanded(stood_still(handler, 0.0, 1.0))
    assert commanded(wind(handler, 1.0, 1.1))
    # A pause is no gap.
    stood_still(handler, 1.1, 3.0)
    wind(handler, 3.0, 3.5)
    assert handler.cadence.largest == pytest.approx(COMMANDS_PERIOD)


def test_the_first_command_loads_nothing():
    script = """
import sys
sys.path.append("tests/processes")
from tests.lay_control_node.test_handler import begun, wind
handler = begun(brake=True, markers_every_turn=True)
before = set(sys.modules)
assert wind(handler, 0.0, 0.001)
ours = ("scipy", "numpy", "lay_control_node", "winding_core")
print([name for name in set(sys.modules) - before if name.startswith(ours)])
"""
    done = python(script, cwd=Path(__file__).parents[2])
    assert done.stdout == "[]\n", done.stdout + done.stderr


def bad_messages() -> list[Any]:
    reading = DRIVE.reading_at(1.0)
    nowhere = replace(reading, cylinder_angle=math.nan)
    inside = replace(reading, guide=GuidePlace(x=0.001, y=0.0))
    good = encode_joint_state(1.0, reading)
    wrong = encode_cloud(1.0, np.zeros(1, dtype=[("x", "<f4"), ("y", "<f4")]))
    return [
        pytest.param(topics.JOINT_STATES, encode_joint_state(1.0, nowhere), id="no angle"),
        pytest.param(topics.JOINT_STATES, encode_joint_state(1.0, inside), id="guide in the cable"),
        pytest.param(topics.JOINT_STATES, good[: len(good) // 2], id="half a joint state"),
        pytest.param(topics.JOINT_STATES, b"", id="empty joint state"),
        pytest.param(topics.TENSION, encode_tension(1.0, math.inf), id="infinite pull"),
        pytest.param(topics.TENSION, b"\x00\x01", id="short pull"),
        pytest.param(topics.TRACKED_MARKERS, wrong, id="markers of other fields"),
        pytest.param(topics.TRACKED_LAY, wrong, id="lay of other fields"),
        pytest.param(topics.FEM_MARKERS, b"\xff" * 40, id="markers of noise"),
    ]


@pytest.mark.parametrize(("topic", "data"), bad_messages())
def test_message_that_cannot_be_used_changes_nothing(topic: Any, data: bytes) -> None:
    hurt, unhurt = begun(), begun()
    for handler in (hurt, unhurt):
        wind(handler, 0.0, 1.0)
    with pytest.raises(MessageError):
        list(hurt.take(topic, data))
    after, expected = (states(wind(handler, 1.001, 1.2)) for handler in (hurt, unhurt))
    assert after.tobytes() == expected.tobytes()


@pytest.mark.parametrize("field", ["theta", "z", "sigma_z"])
def test_place_that_is_not_a_number_moves_nothing(field: str) -> None:
    hurt, unhurt = begun(), begun()
    for handler in (hurt, unhurt):
        wind(handler, 0.0, 4.0)
    places = np.zeros(3, dtype=LAY_DTYPE)
    places["theta"] = (1.0, 2.0, 3.0)
    places["z"] = 0.003
    places["sigma_z"] = 1.0e-4
    places[field] = math.nan
    list(hurt.take(topics.TRACKED_LAY, encode_cloud(4.0, places)))
    markers = np.zeros(1, dtype=MARKER_DTYPE)
    markers["id"] = 1
    markers["theta"] = 4.0
    markers["z"] = 0.01
    markers["sigma_z"] = 1.0e-4
    markers[field] = math.nan
    for k in range(40):
        list(hurt.take(topics.TRACKED_MARKERS, encode_cloud(4.0 + 0.005 * k, markers)))
    after, expected = (states(wind(handler, 4.0, 4.2)) for handler in (hurt, unhurt))
    for name in ("z", "guide", "guide_speed", "free_length", "load_share"):
        assert np.isfinite(after[name]).all(), name
        np.testing.assert_array_equal(after[name], expected[name])
