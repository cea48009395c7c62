"""Watches the axes of a graph by its own eyes: observer.py; each line of input is noted.

It shares no code with what it watches: it reads the encoders from DDS, and takes speeds from their
positions. It prints `ready`, `moves` at the first motion, and its account after the line `ended`.
"""

import json
import math
import sys
import threading
import time
from collections import deque
from typing import Any

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

_STILL, _LOOK = 0.01, 0.3  # The axes stand when the cylinder turns by less [rad] within so long [s]
_JUMP = 0.5  # No cylinder turns so far between two samples [rad]
_SILENT = 0.6  # Nothing is known of a machine that is silent for so long [s]


class Observer:
    """Keeps where the cylinder was, and when what was put in."""

    def __init__(self) -> None:
        self.first: float | None = None  # Where the cylinder stood at first [rad]
        self.angle = self.farthest = 0.0  # [rad]
        self.way = 0.0  # Turned without what the encoder has jumped [rad]
        self.recent: deque[tuple[float, float]] = deque()  # Arrival [s], angle [rad]
        self.moved: float | None = None  # When it began to, monotonic [s]
        self.notes: list[dict[str, Any]] = []
        self.lock = threading.Lock()

    def see(self, message: JointState) -> None:
        """Take an encoder sample."""
        place = dict(zip(message.name, message.position, strict=False)).get("cylinder_joint")
        if place is None or not math.isfinite(place):
            return
        now = time.monotonic()
        with self.lock:
            self.first = place if self.first is None else self.first
            step = place - self.first - self.angle
            self.way += step if abs(step) < _JUMP else 0.0
            self.angle += step
            self.farthest = max(self.farthest, self.angle)
            self.recent.append((now, place))
            while self.recent[0][0] < now - _LOOK:
                self.recent.popleft()
            if self.moved is None and self.way > _STILL:
                self.moved = now
                print("moves", flush=True)

    @property
    def motion(self) -> str:
        """Whether the machine stands or turns, or is not heard."""
        with self.lock:
            silent = not self.recent or time.monotonic() - self.recent[-1][0] > _SILENT
        return "unknown" if silent else self.last_motion

    @property
    def last_motion(self) -> str:
        """Whether the machine stood or turned when it was last heard."""
        with self.lock:
            angles = [angle for _, angle in self.recent]
        return "standing" if not angles or max(angles) - min(angles) < _STILL else "turning"

    def note(self, words: str) -> None:
        """Note what happens to the graph."""
        with self.lock:
            turns = self.angle / math.tau
        self.notes.append({"what": words, "at": time.monotonic(), "turns": turns})

    def account(self) -> dict[str, Any]:
        """Return what was seen."""
        return {
            "motion": self.motion,
            "last_motion": self.last_motion,
            "turns": self.angle / math.tau,
            "farthest": self.farthest / math.tau,
            "moved": self.moved,
            "notes": self.notes,
        }


def main() -> None:
    """Observe until the input ends."""
    rclpy.init(signal_handler_options=rclpy.SignalHandlerOptions.NO)
    node, observer = Node("observer"), Observer()
    node.create_subscription(JointState, "rig/joint_states", observer.see, qos_profile_sensor_data)
    executor, over = EventsExecutor(), threading.Event()
    executor.add_node(node)

    def spin() -> None:
        while not over.is_set():
            executor.spin_once(timeout_sec=0.1)

    spinning = threading.Thread(target=spin)
    spinning.start()
    print("ready", flush=True)
    for line in sys.stdin:
        observer.note(line.strip())
        if line.strip() == "ended":
            # Its last look is one at the machine as the command has left it.
            time.sleep(_SILENT + 0.1)
            print(json.dumps(observer.account()), flush=True)
    over.set()
    spinning.join()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
