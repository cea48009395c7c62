"""The rig's node with a lay that its own motion makes."""

import json
from typing import Any

import pytest
from commanded_machine import targets, winding
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from winding_core.commands import AxisTarget, TensionCommand
from winding_core.status import Level
from winding_rig_node.machine.pace import Pace
from winding_rig_node.node import RigNode
from winding_rig_node.ros.outputs import rig_status


def rig_of(ros: Any, **parameters: object) -> RigNode:
    values = {"speed": 0.0, "duration": 0.5, "lay": "driven", **parameters}
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    node: RigNode = ros.add(RigNode, parameter_overrides=overrides)
    return node


def started(ros: Any, node: RigNode) -> Any:
    """Return what calls a service of an active rig that winds."""
    assert node.trigger_configure() is TransitionCallbackReturn.SUCCESS
    assert node.trigger_activate() is TransitionCallbackReturn.SUCCESS
    probe = ros.plain()

    def call(name: str) -> Any:
        return ros.call(probe, Trigger, f"rig/{name}", Trigger.Request())

    assert call("start").success
    return call


@pytest.mark.parametrize("lay", ["driven", "paper"])
def test_the_truth_is_there_at_the_end_of_the_run(ros, tmp_path, lay):
    file = tmp_path / "truth.json"
    node = rig_of(ros, lay=lay, truth_file=str(file))
    started(ros, node)
    ros.spin_until(lambda: node.status().message == "finished")
    ros.spin_until(file.exists)
    told = json.loads(file.read_text())
    turned = node._loop.machine.state.cylinder.motor.position
    assert told["wound_angle"] == pytest.approx(turned)
    assert ("free_length" in told["hidden"]) == (lay == "driven")


def test_the_truth_of_a_run_that_is_ended_early_is_written_too(ros, tmp_path):
    file = tmp_path / "truth.json"
    node = rig_of(ros, duration=60.0, truth_file=str(file))
    started(ros, node)
    ros.spin_until(lambda: node._lay.wound_angle > 0.5)
    assert node.trigger_deactivate() is TransitionCallbackReturn.SUCCESS
    assert json.loads(file.read_text())["wound_angle"] == node._lay.wound_angle > 0.5


def test_a_reset_begins_with_a_bare_cylinder(ros):
    node = rig_of(ros, duration=60.0)
    call = started(ros, node)
    ros.spin_until(lambda: node._lay.wound_angle > 0.5)
    assert call("stop").success
    ros.spin_until(lambda: node.status().message == "idle")
    assert call("reset").success
    assert node._lay.wound_angle == 0.0
    assert call("start").success
    # Its camera goes on, too: a picture that could not be drawn would fail the node.
    ros.spin_until(lambda: node._lay.wound_angle > 0.5)
    assert not node._loop._failed


def test_the_camera_goes_on_after_a_pause_of_the_node(ros):
    node = rig_of(ros, duration=60.0)
    call = started(ros, node)
    ros.spin_until(lambda: node._lay.wound_angle > 0.3)
    assert node.trigger_deactivate() is TransitionCallbackReturn.SUCCESS
    assert node.trigger_activate() is TransitionCallbackReturn.SUCCESS
    stood = node._lay.wound_angle
    assert call("start").success
    ros.spin_until(lambda: node._lay.wound_angle > stood + 0.3)
    assert not node._loop._failed


def test_a_camera_elsewhere_cannot_show_it(ros):
    node = rig_of(ros, camera_elsewhere=True)
    assert node.trigger_configure() is TransitionCallbackReturn.FAILURE
    assert "camera_elsewhere must be false" in node._failure


def test_a_truth_file_without_a_folder_is_refused(ros, tmp_path):
    node = rig_of(ros, truth_file=str(tmp_path / "absent" / "truth.json"))
    assert node.trigger_configure() is TransitionCallbackReturn.FAILURE
    assert "truth_file must name a file in a folder that exists" in node._failure


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
