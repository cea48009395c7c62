"""Stop and start of a machine whose axes are commanded."""

from collections.abc import Callable

import pytest
from commanded_machine import carriage, run, targets, winding

from winding_core.commands import AxisTarget
from winding_core.drive import DriveProfile
from winding_rig_node.machine.machine import Machine
from winding_rig_node.machine.machine_config import PhaseError


def test_start_gives_the_axes_back_to_the_programme() -> None:
    rig = winding()
    rig.command(targets(carriage=AxisTarget(position=0.02)))
    run(rig, 1.0)
    rig.stop()
    run(rig, 3.0)
    where, asked = carriage(rig), rig.setpoints().carriage_position
    rig.start()
    assert rig.setpoints().carriage_position == pytest.approx(asked)
    run(rig, 5.0)
    assert carriage(rig) == pytest.approx(where + 4.5 * DriveProfile().feed_speed, abs=0.1e-3)
    assert "carriage" not in rig.commander.axes


def test_start_waits_until_commanded_axes_stand() -> None:
    rig = winding()
    rig.command(targets(carriage=AxisTarget(speed=0.05)))
    run(rig, 0.3)
    rig.stop()
    with pytest.raises(PhaseError, match="a commanded axis is coming to rest"):
        rig.start()


@pytest.mark.parametrize("stop", [Machine.quick_stop, Machine.emergency_stop])
def test_a_hurried_stop_brings_commanded_axes_to_rest_as_well(
    stop: Callable[[Machine], object],
) -> None:
    rig = winding()
    rig.command(targets(carriage=AxisTarget(speed=0.08), cylinder=AxisTarget(speed=4.0)))
    run(rig, 0.45)
    stop(rig)
    began = rig.time
    run(rig, 3.0)
    assert rig.state.stood_at is not None
    # 0.3 s to rest, and what the brake needs for the last of it.
    assert rig.state.stood_at - began < 0.35
