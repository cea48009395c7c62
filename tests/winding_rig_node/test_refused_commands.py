"""What a machine cannot do is refused with value and limit, and changes nothing."""

from collections.abc import Callable, Iterator
from dataclasses import astuple

import pytest
from commanded_machine import course, machine, run, targets, winding

from winding_core.machine.commands import AxisTarget, Command, TensionCommand
from winding_rig_node.machine.commander import CommandError
from winding_rig_node.machine.machine import Machine


def refused(rig: Machine, command: Command) -> str:
    """Return why a command is refused, which changes nothing."""
    before = (dict(rig.commander.axes), rig.commander.brake)
    with pytest.raises(CommandError) as caught:
        rig.command(command)
    assert (rig.commander.axes, rig.commander.brake) == before
    assert rig.commander.refusal == str(caught.value)
    return str(caught.value)


def test_a_refused_command_leaves_every_number_as_it_was() -> None:
    rigs = winding(), winding()
    refused(rigs[0], targets(carriage=AxisTarget(position=2.0), cylinder=AxisTarget(speed=1.0)))
    for rig in rigs:
        run(rig, 2.0)
    assert astuple(rigs[0].reading()) == astuple(rigs[1].reading())
    assert rigs[0].state.tension == rigs[1].state.tension


@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        (
            targets(carriage=AxisTarget(position=1.2)),
            "carriage position must lie in -0.1 to 1 m, got 1.2",
        ),
        (
            targets(carriage=AxisTarget(speed=-0.2)),
            "carriage speed must be at most 0.08 m/s, got -0.2",
        ),
        (
            targets(cylinder=AxisTarget(speed=9.0)),
            "cylinder speed must be at most 8 rad/s, got 9",
        ),
        (
            targets(12.0, cylinder=AxisTarget(speed=1.0)),
            "a command must be stamped within 0.5 s of the machine's time, 1.000 s, it is of "
            "12.000 s",
        ),
        (
            course((1.0, 0.1)),
            "the carriage trajectory must stay within 0.08 m/s, it asks for 0.0975 at 0.000 s "
            "from now",
        ),
        (
            course((0.5, 0.02, 0.0), (0.7, 0.033, 0.0)),
            "the carriage trajectory must stay within 0.08 m/s, it asks for 0.0975 at 0.600 s "
            "from now",
        ),
        (
            course((0.5, 0.02, 0.0), (0.6, 0.025, 0.05), (2.0, 0.03, 0.0)),
            "the carriage trajectory must stay within 0.5 m/s^2, it asks for 2 at 0.500 s from now",
        ),
        (
            course((1.0, -0.05), (2.0, -0.12)),
            "carriage position must lie in -0.1 to 1 m, got -0.12",
        ),
        (
            course((1.0, 0.01, 0.01)),
            "the carriage trajectory must end at rest, it ends at 0.01 m/s",
        ),
        (
            course((0.1, 0.01), t=0.5),
            "the carriage trajectory must end after now, 1.000 s, it ends at 0.600 s",
        ),
        (TensionCommand(t=0.0, force=25.0), "tension must lie in 0.1 to 20 N, got 25"),
    ],
)
def test_what_is_out_of_bounds_is_refused_with_value_and_limit(
    command: Command, sentence: str
) -> None:
    assert refused(winding(), command) == sentence


def test_a_cubic_that_overshoots_the_travel_is_refused() -> None:
    rig = winding()
    # Both ends lie within; the way on from -0.09 m at -0.05 m/s does not.
    assert refused(rig, course((4.0, -0.09, -0.05), (8.0, -0.09, 0.0))).startswith(
        "carriage position must lie in -0.1 to 1 m, got -0.1"
    )


def phases() -> Iterator[tuple[str, Callable[[Machine], object]]]:
    yield "idle", Machine.reset
    yield "stopping", Machine.stop
    yield "emergency stop", Machine.emergency_stop
    yield "protective stop", lambda rig: rig.protect("on purpose")


@pytest.mark.parametrize(("phase", "bring"), list(phases()), ids=lambda value: str(value)[:9])
def test_only_a_machine_that_winds_takes_commands(
    phase: str, bring: Callable[[Machine], object]
) -> None:
    rig = machine() if phase == "idle" else winding()
    bring(rig)
    said = refused(rig, targets(carriage=AxisTarget(speed=0.01)))
    assert said == f"commands are taken while the machine winds, it is in {phase}"
