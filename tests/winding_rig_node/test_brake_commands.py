"""The brake follows commands, and a reset takes them back."""

import math

import pytest
from commanded_machine import run, winding

from winding_core.commands import TensionCommand
from winding_rig_node.machine.machine_config import Phase


def test_the_brake_follows_a_tension_command_with_its_lag() -> None:
    rig = winding()
    rig.command(TensionCommand(t=0.0, force=4.0))
    weight = rig.config.case.weight
    run(rig, rig.config.commands.brake_time)
    # After one time constant of a first order; three deviations of the load cell's noise.
    lagged = 4.0 + (weight - 4.0) * math.exp(-1.0)
    assert rig.state.tension == pytest.approx(lagged, abs=0.04)
    run(rig, 3.0)
    assert rig.state.tension == pytest.approx(4.0, abs=0.04)
    assert rig.state.phase is Phase.WINDING


def test_reset_puts_the_dead_weight_back() -> None:
    rig = winding()
    rig.command(TensionCommand(t=0.0, force=4.0))
    rig.stop()
    run(rig, 3.0)
    rig.reset()
    rig.start()
    assert rig.state.tension == pytest.approx(rig.config.case.weight, abs=0.04)
