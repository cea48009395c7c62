"""ROS adapter of the operator's page: one thread spins for answers, looks come on request."""

import math
import os
import threading
import time
from typing import Any

from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter

from winding_core.run_options import COMPONENT, OperatorLimits
from winding_core.status import Status
from winding_dashboard.ros.parameters import DashboardParameters
from winding_dashboard.ros.service_client import NODES, ServiceClient
from winding_dashboard.ros.topic_reader import TopicReader
from winding_dashboard.state.view_state import ViewState
from winding_ros import topics
from winding_ros.graph import PAGE
from winding_ros.messages.diagnostics import encode_diagnostics
from winding_ros.runtime.heartbeat import Heartbeat
from winding_ros.runtime.node_parameters import (
    DECLARED_FROM_OVERRIDES,
    add_parameter_validation,
    declare_parameters,
    read_parameters,
)
from winding_ros.runtime.process import SUPERVISED

NAME = topics.DASHBOARD
# EventsExecutor.spin() of rclpy 7.1 never returns to the interpreter; spin_once does.
_SPIN_PERIOD = 0.1


class DashboardNode(Node):  # type: ignore[misc]
    """Plain node `dashboard`: reads every topic of the graph.

    Calls rig/start, rig/stop, rig/reset, rig/emergency_stop, lay_control/off, lay_control/watch,
    lay_control/drive, recorder/record, and the lifecycle and parameter services of the graph's
    nodes. A supervised one publishes heartbeats and, in /diagnostics, the operator's limits;
    any client may set those two parameters.

    Raises:
        ParameterError: A parameter is refused.
    """

    def __init__(self, context: Context, **kwargs: Any) -> None:
        super().__init__(NAME, context=context, **DECLARED_FROM_OVERRIDES, **kwargs)
        self.parameters = declare_parameters(self, DashboardParameters)  # As the page was started
        # Secret that a browser must bring; empty for none. It is no parameter.
        self.token = self.parameters.token()
        add_parameter_validation(self, DashboardParameters, lambda: True)
        # What the page shows.
        self.state = ViewState(
            nodes=tuple(reversed(self.parameters.named_nodes or NODES)),
            machine=topics.RIG,
            solver=topics.FEM,
            quantities=tuple(
                topic.quantity for topic in PAGE.extra_subscriptions if topic.quantity
            ),
        )
        self._watcher = Node(
            f"{NAME}_eyes",
            context=context,
            start_parameter_services=False,
            enable_rosout=False,
            cli_args=kwargs.get("cli_args"),
        )
        # Takes the newest messages into the state.
        self.topic_reader = TopicReader(self._watcher, self.parameters, self.state)
        self._executor = EventsExecutor(context=context)
        self._executor.add_node(self)
        # Calls the graph's services.
        self.service_client = ServiceClient(
            self,
            self._executor.wake,
            self.state.health,
            time.monotonic,
            self.parameters.named_nodes,
        )
        # Two pages of one graph may not vouch for each other.
        supervised = bool(os.environ.get(SUPERVISED))
        self._heartbeat = Heartbeat(self, NAME) if supervised else None
        self._diagnostics = topics.DIAGNOSTICS.advertise(self) if supervised else None
        self._quit = threading.Event()
        self._thread = threading.Thread(target=self._spin, name="dashboard")

    def start(self) -> None:
        """Begin to spin."""
        self._thread.start()

    def beat(self) -> None:
        """Say that the page is being served."""
        if self._heartbeat is not None:
            self._heartbeat.beat()

    def look_for_player(self) -> None:
        """Look whether a recording is played in the machine's place; it stays what is shown."""
        player = self.service_client.player()
        self.state.player = self.state.player if player is None else player

    @property
    def limits(self) -> OperatorLimits:
        """What counts as good now."""
        return read_parameters(self, OperatorLimits)

    def set_limits(self, limits: OperatorLimits) -> None:
        """Take what an operator has set on the page."""
        self.set_parameters([Parameter(name, value=value) for name, value in vars(limits).items()])
        self.state_limits()

    def state_limits(self) -> None:
        """Say what counts as good, for those who judge the run and start a next page."""
        if self._diagnostics is not None:
            time_now = self.state.time if math.isfinite(self.state.time) else 0.0
            status = Status(name=f"{NAME}: {COMPONENT}", values=self.limits.values())
            message = encode_diagnostics(time_now, [status], hardware_id=self.get_namespace())
            self._diagnostics.publish(message)

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
