"""A driver of examples/ whose faults are asked for: foreign_driver.py FILE; one a line of input."""

from __future__ import annotations

import math
import runpy
import sys
import threading
from functools import partial
from typing import Any

import rclpy
from rclpy.duration import Duration
from rclpy.signals import SignalHandlerOptions
from rclpy.time import Time

from winding_ros.runtime.process import end_with_supervisor

_STOPS = ("stop", "quick_stop")
# A turn of so much between two samples is no motion [rad].
_JUMP = 1.9
_SHIFT, _BACK = 0.7, -0.4
_BURST = 60  # Samples out of order, or without numbers


class UnansweredError(Exception):
    """A service that is taken and never answered."""


class _Publisher:
    """Publishes what a faulty machine reports of itself."""

    def __init__(self, publisher: Any, faults: Faults) -> None:
        self._publisher, self._faults = publisher, faults

    def publish(self, message: Any) -> None:
        faults = self._faults
        shift = faults.shift + (_BACK if faults.back > 0 else 0.0)
        if shift:
            stamp = Time.from_msg(message.header.stamp) + Duration(nanoseconds=int(1e9 * shift))
            message.header.stamp = stamp.to_msg()
        if hasattr(message, "position"):
            faults.back -= 1
            faults.nan -= 1
            message.position[0] = math.nan if faults.nan > 0 else message.position[0]
            message.position[0] += faults.offset
        self._publisher.publish(message)


class Faults:
    """What is wrong with a machine."""

    def __init__(self) -> None:
        self.stops = ""  # unanswered, refused or ignored
        self.shift = self.offset = 0.0  # [s], [rad]
        self.back = self.nan = 0  # Samples that are still to be so

    def take(self, words: str, driver: Any) -> None:
        """Begin a fault by its name."""
        if words == "stops early":
            driver.goal = 0.0
        elif words == "jumps":
            self.offset += _JUMP
        elif words == "shifts its clock":
            self.shift += _SHIFT
        elif words == "goes back in time":
            self.back = _BURST
        elif words == "sends NaN":
            self.nan = _BURST
        else:
            self.stops = words.removeprefix("stops ")

    def serve(self, call: Any, request: Any, response: Any) -> Any:
        """Serve a request as well as the machine still can.

        Raises:
            UnansweredError: It never gets an answer.
        """
        if call.__name__ not in _STOPS or not self.stops:
            return call(request, response)
        if self.stops == "unanswered":
            raise UnansweredError
        response.success = self.stops == "ignored"
        response.message = "interlocked"
        return response


def main(file: str) -> None:
    """Drive until killed."""
    end_with_supervisor()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    faults = Faults()
    kind: Any = runpy.run_path(file)["Driver"]

    class Faulty(kind):  # type: ignore[misc]
        """The driver, whose services may fail."""

        def create_service(self, served: type, name: str, call: Any, **options: Any) -> Any:
            serve = partial(faults.serve, call)
            return super().create_service(served, name, serve, **options)

    driver = Faulty()
    driver.joints = _Publisher(driver.joints, faults)
    driver.tension = _Publisher(driver.tension, faults)

    def listen() -> None:
        for line in sys.stdin:
            faults.take(line.strip(), driver)

    threading.Thread(target=listen, daemon=True).start()
    print("ready", flush=True)
    while True:
        try:
            rclpy.spin_once(driver, timeout_sec=0.1)
        except UnansweredError:
            continue


if __name__ == "__main__":
    main(sys.argv[1])
