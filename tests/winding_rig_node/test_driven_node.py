"""The rig's node with a lay that its own motion makes."""

import json
from typing import Any

import pytest
from commanded_machine import targets, winding
from rclpy.lifecycle import TransitionCallbackReturn
from rig_bench import RigBench, refusal

from winding_core.commands import AxisTarget, TensionCommand
from winding_core.status import Level
from winding_rig_node.machine.pace import Pace
from winding_rig_node.ros.outputs import rig_status


def driven(ros: Any, **parameters: object) -> RigBench:
    """Return the bench of a rig with such a lay that winds."""
    bench = RigBench(ros, **({"lay": "driven", "duration": 60.0} | parameters))
    bench.start()
    return bench


@pytest.mark.parametrize("lay", ["driven", "paper"])
def test_the_truth_is_there_at_the_end_of_the_run(ros, tmp_path, lay):
    file = tmp_path / "truth.json"
    bench = driven(ros, lay=lay, duration=0.5, truth_file=str(file))
    bench.wait_for("finished")
    ros.spin_until(file.exists)
    written = json.loads(file.read_text())
    turned = bench.node._loop.machine.state.cylinder.motor.position
    assert written["wound_angle"] == pytest.approx(turned)
    assert ("free_length" in written["hidden"]) == (lay == "driven")


def test_the_truth_of_a_run_that_is_ended_early_is_written_too(ros, tmp_path):
    file = tmp_path / "truth.json"
    bench = driven(ros, truth_file=str(file))
    bench.wound(0.5)
    assert bench.node.trigger_deactivate() is TransitionCallbackReturn.SUCCESS
    assert json.loads(file.read_text())["wound_angle"] == bench.node._lay.wound_angle > 0.5


def test_a_reset_begins_with_a_bare_cylinder(ros):
    bench = driven(ros)
    bench.wound(0.5)
    assert bench.command("stop").success
    bench.wait_for("idle")
    assert bench.command("reset").success
    assert bench.node._lay.wound_angle == 0.0
    bench.start()
    # Its camera goes on, too: a picture that could not be drawn would fail the node.
    bench.wound(0.5)
    assert not bench.node._loop._failed


def test_the_camera_goes_on_after_a_pause_of_the_node(ros):
    bench = driven(ros)
    bench.wound(0.3)
    assert bench.node.trigger_deactivate() is TransitionCallbackReturn.SUCCESS
    assert bench.node.trigger_activate() is TransitionCallbackReturn.SUCCESS
    stood = bench.node._lay.wound_angle
    bench.start()
    bench.wound(stood + 0.3)
    assert not bench.node._loop._failed


def test_what_cannot_be_shown_or_written_is_refused(ros, tmp_path):
    sentence = refusal(ros, lay="driven", camera_elsewhere=True)
    assert "camera_elsewhere must be false" in sentence
    sentence = refusal(ros, truth_file=str(tmp_path / "absent" / "truth.json"))
    assert "truth_file must name a file in a folder that exists" in sentence


@pytest.mark.parametrize(
    "command", [targets(carriage=AxisTarget(speed=0.01)), TensionCommand(t=0.0, force=2.0)]
)
def test_commands_that_the_picture_does_not_follow_are_warned_of(command):
    machine, pace = winding(), Pace([], 0.25)
    assert rig_status(machine, pace, "", "fem").level is Level.OK
    machine.command(command)
    status = rig_status(machine, pace, "", "fem")
    assert status.level is Level.WARN
    assert status.message == "winding: the camera shows lay 'fem', which does not follow commands"
    assert rig_status(machine, pace, "", "").level is Level.OK
