"""The page's node on a real graph of topics and services."""

import asyncio
import os
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from axis_readings import axis_reading
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from winding_core.machine.readings import CABLE_TENSION
from winding_core.markers import wound_markers
from winding_core.parameters import ParameterError
from winding_core.run_options import OperatorLimits
from winding_core.status import Status
from winding_dashboard.node import DashboardNode
from winding_dashboard.page.commands import CommandError
from winding_dashboard.ros import topic_reader
from winding_ros import topics
from winding_ros.messages.clouds import encode_cloud
from winding_ros.messages.diagnostics import (
    decode_diagnostics,
    encode_case_votes,
    encode_diagnostics,
)
from winding_ros.messages.rig import encode_joint_state, encode_tension
from winding_ros.runtime.process import SUPERVISED


@pytest.fixture
def dashboard(ros: Any) -> Iterator[DashboardNode]:
    node = DashboardNode(ros.context)
    node.start()
    yield node
    node.close()


def look_until(ros: Any, dashboard: DashboardNode, reached: Any) -> None:
    def look() -> bool:
        dashboard.topic_reader.look(time.monotonic())
        return bool(reached())

    ros.spin_until(look)


def test_newest_of_every_topic_is_shown(ros: Any, dashboard: DashboardNode) -> None:
    probe, state = ros.plain(), dashboard.state
    out = {
        topic: topic.advertise(probe)
        for topic in (
            topics.JOINT_STATES, topics.TENSION, topics.TRACKED_MARKERS, topics.FEM_PREDICTION,
            topics.CORRECTION_CASE, topics.DIAGNOSTICS,
        )
    }  # fmt: skip
    ros.spin_until(lambda: all(item.get_subscription_count() for item in out.values()))
    markers = wound_markers(
        ids=[1], theta=np.array([6.0]), z=[0.01], radius=0.017, cylinder_angle=2.0
    )
    for sample in range(200):
        reading = axis_reading(0.01 * sample, speed=1.0)
        out[topics.JOINT_STATES].publish(encode_joint_state(0.001 * sample, reading))
    out[topics.TENSION].publish(encode_tension(0.2, 3.9))
    out[topics.TRACKED_MARKERS].publish(encode_cloud(0.2, markers))
    out[topics.FEM_PREDICTION].publish(encode_cloud(0.0, markers))
    out[topics.CORRECTION_CASE].publish(encode_case_votes(0.2, {4: 0.6, 7: 0.4}))
    out[topics.DIAGNOSTICS].publish(
        encode_diagnostics(0.2, [Status(name="winding_rig", message="winding")])
    )
    look_until(
        ros,
        dashboard,
        lambda: (
            state.axes is not None
            and state.axes.cylinder_angle == pytest.approx(1.99)
            and state.measured[CABLE_TENSION] == 3.9
            and len(state.tracked) == len(state.ahead) == 1
            and state.votes == {4: 0.6, 7: 0.4}
            and state.phase == "winding"
        ),
    )
    # One look takes one sample of the chart, however many messages came in between.
    assert len(state.speeds) < 20


def test_message_that_cannot_be_used_is_counted_and_changes_nothing(
    ros: Any, dashboard: DashboardNode
) -> None:
    out = topics.TENSION.advertise(ros.plain())
    ros.spin_until(out.get_subscription_count)
    out.publish(encode_tension(0.0, float("nan")))
    look_until(ros, dashboard, lambda: dashboard.topic_reader.refused == 1)
    assert np.isnan(dashboard.state.measured[CABLE_TENSION])


def test_command_is_unavailable_until_one_serves_it(ros: Any, dashboard: DashboardNode) -> None:
    assert dashboard.service_client.unavailable("stop") == "no node serves rig/stop in /"
    assert "does not serve" in dashboard.service_client.unprepared()
    probe = ros.plain()

    def serve(_request: Any, response: Any) -> Any:
        response.success, response.message = True, "stopping"
        return response

    probe.create_service(Trigger, "rig/stop", serve)
    ros.spin_until(lambda: not dashboard.service_client.unavailable("stop"))
    assert spin_beside(ros, dashboard.service_client.command("stop")) == "stopping"


def test_who_plays_a_recording_is_no_machine_until_one_serves_its_commands(
    ros: Any, dashboard: DashboardNode
) -> None:
    """As `winding bag play` publishes it, and a driver beside it."""
    driver = ros.plain("some_driver")
    publisher = topics.JOINT_STATES.advertise(driver)
    ros.spin_until(publisher.get_subscription_count)
    dashboard.look_for_player()
    assert dashboard.state.player == ""
    player = ros.plain("bag_player")
    publisher = topics.FEM_MARKERS.advertise(player)

    def looked() -> str:
        dashboard.look_for_player()
        return dashboard.state.player

    ros.spin_until(lambda: looked() == "bag_player")
    # What was played is shown after its end, too, and is no machine.
    player.destroy_publisher(publisher)
    ros.spin_until(lambda: dashboard.service_client.player() is None)
    assert looked() == "bag_player"
    driver.create_service(Trigger, "rig/stop", lambda _request, response: response)
    ros.spin_until(lambda: looked() == "")


def test_topic_without_a_row_is_shown_as_text(ros: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    further = replace(topics.TENSION, name="rig/sag", quantity=None, rate=None)
    spec = replace(topic_reader.PAGE, extra_subscriptions=(topics.DIAGNOSTICS, further))
    monkeypatch.setattr(topic_reader, "PAGE", spec)
    page = DashboardNode(ros.context)
    try:
        out = further.advertise(ros.plain())
        ros.spin_until(out.get_subscription_count)
        out.publish(encode_tension(0.3, 5.25))
        look_until(ros, page, lambda: page.state.others == {"rig/sag": "5.25"})
    finally:
        page.start()
        page.close()


@pytest.mark.slow
def test_unanswered_emergency_stop_refers_to_the_machine_s_button(dashboard: DashboardNode) -> None:
    with pytest.raises(CommandError, match="use the machine's own button"):
        asyncio.run(dashboard.service_client.command("emergency_stop"))


def test_supervised_page_publishes_its_limits(ros: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    published: list[OperatorLimits | None] = []
    probe = ros.plain()

    def note(message: Any) -> None:
        _, (status,) = decode_diagnostics(message)
        assert status.name == "dashboard: limits"
        published.append(OperatorLimits.from_values(status.values))

    topics.DIAGNOSTICS.subscribe(probe, note)
    monkeypatch.setenv(SUPERVISED, str(os.getpid()))
    page = DashboardNode(ros.context)
    try:
        ros.spin_until(lambda: page.count_subscribers(topics.DIAGNOSTICS.name) == 2)
        limits = OperatorLimits(error_limit_pct=1.0 / 3.0, lay_tolerance=0.1e-3)
        page.set_limits(limits)
        ros.spin_until(lambda: limits in published)
        (refused,) = page.set_parameters([Parameter("error_limit_pct", value=2000.0)])
        assert not refused.successful
        assert page.limits == limits
    finally:
        page.start()
        page.close()


def test_open_host_without_token_is_refused_before_the_node_works(ros: Any) -> None:
    with pytest.raises(ParameterError, match=r"host 0\.0\.0\.0 can be reached"):
        DashboardNode(ros.context, parameter_overrides=[Parameter("host", value="0.0.0.0")])


def spin_beside(ros: Any, work: Any) -> Any:
    """Await work while the harness spins the nodes of the test."""

    async def both() -> Any:
        task = asyncio.ensure_future(work)
        while not task.done():
            ros.executor.spin_once(timeout_sec=0.01)
            await asyncio.sleep(0)
        return task.result()

    return asyncio.run(both())
