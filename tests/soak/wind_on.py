"""The operator of a session: Reset and Start, run after run; wind_on.py NAMESPACE MINUTES.

It prints `winding` when the machine winds for the first time, and then a line for every run.
"""

import sys
import time
from typing import Any

import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.node import Node
from std_srvs.srv import Trigger

from winding_ros import topics
from winding_ros.messages.diagnostics import decode_diagnostics


class Operator:
    """Presses the buttons of a machine."""

    def __init__(self, namespace: str) -> None:
        self.node = Node("operator", namespace=namespace)
        self.phase = ""
        topics.DIAGNOSTICS.subscribe(self.node, self._note)

    def _note(self, message: object) -> None:
        _, statuses = decode_diagnostics(message)
        for status in statuses:
            if status.name == topics.RIG:
                self.phase = status.values.get("phase", "")

    def press(self, name: str) -> None:
        """Call a service of the machine."""
        self._call(Trigger, f"rig/{name}", Trigger.Request())

    def reset(self) -> None:
        """Reset the machine, and let its listeners begin a new run, as Reset of the page does."""
        self.press("reset")
        for listener in (topics.FEM, topics.TRACKER, topics.CORRECTION):
            for change in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_ACTIVATE):
                request = ChangeState.Request(transition=Transition(id=change))
                self._call(ChangeState, f"{listener}/change_state", request)

    def _call(self, kind: type, name: str, request: Any) -> None:
        """Call a service until it is taken."""
        client = self.node.create_client(kind, name)
        client.wait_for_service()
        taken = False
        while not taken:
            pending = client.call_async(request)
            rclpy.spin_until_future_complete(self.node, pending, timeout_sec=5.0)
            taken = pending.done() and pending.result().success
        self.node.destroy_client(client)

    def wait_for(self, phase: str) -> None:
        """Wait until the machine is in a phase."""
        while self.phase != phase:
            rclpy.spin_once(self.node)


def wind(namespace: str, minutes: float) -> None:
    rclpy.init()
    operator = Operator(namespace)
    operator.press("start")
    operator.wait_for("winding")
    print("winding", flush=True)
    end = time.monotonic() + 60.0 * minutes
    while time.monotonic() < end:
        operator.wait_for("finished")
        print("a run is over", flush=True)
        operator.reset()
        operator.wait_for("idle")
        operator.press("start")
        operator.wait_for("winding")


if __name__ == "__main__":
    wind(sys.argv[1], float(sys.argv[2]))
