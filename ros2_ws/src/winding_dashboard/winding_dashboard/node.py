"""ROS adapter of the operator's page: one thread spins for answers, looks come on request."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Mapping
from typing import Any

from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter

from winding_dashboard.ros.parameters import DashboardParameters
from winding_dashboard.ros.service_client import NODES, ServiceClient
from winding_dashboard.ros.topic_reader import TopicReader
from winding_dashboard.state.view_state import ViewState
from winding_ros import topics
from winding_ros.graph import PAGE
from winding_ros.heartbeat import Heartbeat
from winding_ros.node_parameters import declare_parameters, refuse_invalid
from winding_ros.process import SUPERVISED

NAME = topics.DASHBOARD
# EventsExecutor.spin() of rclpy 7.1 never returns to the interpreter; spin_once does.
_SPIN_PERIOD = 0.1


class DashboardNode(Node):  # type: ignore[misc]
    """Plain node `dashboard`: reads every topic of the graph, publishes none.

    Calls rig/start, rig/stop, rig/reset, rig/emergency_stop, lay_control/off, lay_control/watch,
    lay_control/drive, recorder/record, and the lifecycle and parameter services of the graph's
    nodes. A supervised one gives signs of life.

    Attributes:
        parameters: Of the page.
        state: What the page shows.
        topic_reader: Takes the newest messages into the state.
        service_client: Calls the graph's services.

    Raises:
        ParameterError: A parameter is refused.
    """

    def __init__(self, context: Context, **kwargs: Any) -> None:
        super().__init__(NAME, context=context, **kwargs)
        self.parameters = declare_parameters(self, DashboardParameters)
        self.parameters.check()
        self._adopting = False
        refuse_invalid(self, DashboardParameters, lambda: not self._adopting)
        self.state = ViewState(
            nodes=tuple(reversed(NODES)),
            machine=topics.RIG,
            solver=topics.FEM,
            quantities=tuple(topic.quantity for topic in PAGE.beside if topic.quantity),
            lay_tolerance=self.parameters.lay_tolerance,
        )
        self._watcher = Node(
            f"{NAME}_eyes",
            context=context,
            start_parameter_services=False,
            enable_rosout=False,
            cli_args=kwargs.get("cli_args"),
        )
        self.topic_reader = TopicReader(self._watcher, self.parameters, self.state)
        self._executor = EventsExecutor(context=context)
        self._executor.add_node(self)
        self.service_client = ServiceClient(
            self, self._executor.wake, self.state.health, time.monotonic
        )
        # Two pages of one graph may not vouch for each other.
        supervised = bool(os.environ.get(SUPERVISED))
        self._heartbeat = Heartbeat(self, NAME) if supervised else None
        self._quit = threading.Event()
        self._thread = threading.Thread(target=self._spin, name="dashboard")

    def start(self) -> None:
        """Begin to spin."""
        self._thread.start()

    def beat(self) -> None:
        """Say that the page is being served."""
        if self._heartbeat is not None:
            self._heartbeat.beat()

    def adopt(self, values: Mapping[str, float]) -> None:
        """Take what an operator has set on the page as parameters, which others may read."""
        self._adopting = True
        try:
            self.set_parameters([Parameter(name, value=value) for name, value in values.items()])
        finally:
            self._adopting = False

    def close(self) -> None:
        """Stop spinning and leave the graph."""
        self._quit.set()
        if self._thread.is_alive():
            self._thread.join()
        self._executor.shutdown()
        self._watcher.destroy_node()
        self.destroy_node()

    def _spin(self) -> None:
        while not self._quit.is_set() and self.context.ok():
            self._executor.spin_once(timeout_sec=_SPIN_PERIOD)
