"""A machine that nobody attends stops by itself; what stands or ends by itself needs nobody."""

import pytest
from commanded_machine import carriage, course, run, targets, winding

from winding_core.commands import AxisTarget, Command, JointTrajectory
from winding_rig_node.machine.commander import CARRIAGE_LIMITS
from winding_rig_node.machine.machine_config import Phase


def test_a_stream_that_stops_in_motion_stops_both_axes() -> None:
    rig = winding()
    rig.command(targets(carriage=AxisTarget(speed=0.05)))
    run(rig, 0.45)
    assert rig.state.phase is Phase.WINDING
    run(rig, 3.0)
    assert rig.state.phase is Phase.IDLE
    assert rig.state.reason == (
        "no command for the carriage for more than 0.5 s while it moves at 0.05 m/s"
    )
    assert rig.state.cylinder.motor.speed == rig.state.carriage.motor.speed == 0.0


def test_a_way_that_nobody_attends_is_not_gone_to_its_end() -> None:
    rig = winding()
    rig.command(targets(carriage=AxisTarget(position=0.3)))
    run(rig, 3.0)
    assert rig.state.phase is Phase.IDLE
    assert carriage(rig) < 0.1


@pytest.mark.parametrize("command", [
    targets(carriage=AxisTarget(position=0.01)),
    targets(carriage=AxisTarget(speed=0.0)),
    course((2.0, 0.05)),
    JointTrajectory(t=0.0, axes={"carriage": (), "cylinder": ()}),
])  # fmt: skip
def test_what_is_reached_stands_or_ends_by_itself_needs_no_stream(command: Command) -> None:
    rig = winding()
    rig.command(command)
    run(rig, 4.0)
    assert rig.state.phase is Phase.WINDING
    assert rig.state.carriage.motor.speed == pytest.approx(0.0, abs=1.0e-5)
    where = carriage(rig)
    run(rig, 4.0)
    assert rig.state.reason == ""
    # One count of the encoder is 0.6 micrometres.
    assert carriage(rig) == pytest.approx(where, abs=2.0e-6)


def test_a_speed_towards_the_end_of_the_travel_stops_before_it() -> None:
    rig = winding()
    while rig.state.phase is Phase.WINDING:
        if rig.state.drive_sample % 20 == 0:
            rig.command(targets(rig.time, carriage=AxisTarget(speed=-0.08)))
        rig.step()
    run(rig, 3.0)
    assert "has to stop before the end of its travel at -0.1 m" in rig.state.reason
    assert CARRIAGE_LIMITS.low <= carriage(rig) < CARRIAGE_LIMITS.low + 5.0e-3
