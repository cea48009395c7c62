"""A winding machine's driver, as short as it can be: put your hardware where the comments are."""

import signal
import threading
from typing import Any

import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

PERIOD, OMEGA, FEED = 0.002, 1.74, 5.0e-3  # s, rad/s, m/s
RAMP, QUICK_RAMP = 1.0, 0.3  # s
DEAD_MAN, FASTEST = 0.5, 0.08  # s between commands, m/s of a commanded carriage


class Driver(Node):
    def __init__(self) -> None:
        super().__init__("winding_rig")
        self.joints = self.create_publisher(JointState, "rig/joint_states", 2000)
        self.tension = self.create_publisher(WrenchStamped, "rig/tension", 2000)
        self.goal = self.share = self.angle = self.carriage = 0.0
        self.ramp, self.latched = RAMP, False  # your safety relay
        self.looks = 0  # samples since the last command: what waits is taken between two of them
        self.target: tuple[Time, float, float] | None = None  # of the carriage: heard, m, m/s
        self.create_subscription(JointState, "rig/joint_targets", self.command, 1)
        for name in ("start", "stop", "quick_stop", "emergency_stop", "reset"):
            self.create_service(Trigger, f"rig/{name}", getattr(self, name))
        self.due = self.get_clock().now()
        self.create_timer(PERIOD, self.sample)
        self.get_logger().info("ready")

    def sample(self) -> None:
        self.looks += 1
        while self.due <= self.get_clock().now():  # what a busy machine missed is made up for
            step = 0.0 if self.latched else PERIOD / self.ramp
            self.share += min(step, max(-step, self.goal - self.share))
            self.angle += self.share * OMEGA * PERIOD  # your encoder of the cylinder [rad]
            feed = self.feed()
            self.carriage += feed * PERIOD  # your encoder of the carriage [m]
            state = JointState(name=["cylinder_joint", "carriage_joint"])
            state.header.stamp = self.due.to_msg()  # when it was taken, not when it was sent
            state.position = [self.angle, self.carriage]
            state.velocity = [self.share * OMEGA, feed]
            force = WrenchStamped(header=state.header)
            force.wrench.force.x = 1.96  # your load cell [N]
            self.joints.publish(state)
            self.tension.publish(force)
            self.due += Duration(seconds=PERIOD)

    def feed(self) -> float:
        """Return the speed of the carriage [m/s]: of the drive programme, or to its target."""
        if self.target is None:
            return self.share * FEED
        heard, place, speed = self.target
        since = 1.0e-9 * (self.due - heard).nanoseconds
        coming = bool(speed) or abs(place - self.carriage) > 1.0e-4
        if since > DEAD_MAN and coming and self.looks > 10:
            # Whoever commanded it is gone, and it was not this process that stood still.
            self.goal, self.ramp, self.target = 0.0, QUICK_RAMP, None
            self.get_logger().error(f"no command for {DEAD_MAN} s: both axes are stopped")
            return self.share * FEED
        way = place + speed * min(max(since, 0.0), 0.1) - self.carriage
        return self.share * min(max(way / 0.05, -FASTEST), FASTEST)

    def command(self, message: JointState) -> None:
        now, stamp = self.get_clock().now(), Time.from_msg(message.header.stamp)
        age = 1.0e-9 * (now - stamp).nanoseconds if stamp.nanoseconds else 0.0
        if not self.goal or abs(age) > DEAD_MAN or "carriage_joint" not in message.name:
            return  # only between start and stop, and only in time
        at = message.name.index("carriage_joint")
        self.target, self.looks = (now, message.position[at], message.velocity[at]), 0

    def start(self, _: Any, response: Trigger.Response) -> Trigger.Response:
        self.goal, self.ramp, response.success = 1.0, RAMP, not self.latched
        self.target = None
        response.message = "emergency stop: reset first" if self.latched else "winding"
        return response

    def stop(self, _: Any, response: Trigger.Response) -> Trigger.Response:
        self.goal, response.success, self.target = 0.0, True, None
        return response

    def quick_stop(self, _: Any, response: Trigger.Response) -> Trigger.Response:
        self.goal, self.ramp, response.success, self.target = 0.0, QUICK_RAMP, True, None
        return response

    def emergency_stop(self, _: Any, response: Trigger.Response) -> Trigger.Response:
        self.goal, self.share, self.latched, response.success = 0.0, 0.0, True, True
        return response

    def reset(self, _: Any, response: Trigger.Response) -> Trigger.Response:
        self.goal, self.latched, response.success = 0.0, False, True
        return response


if __name__ == "__main__":
    # rclpy would end its context in the middle of a publication, and an exception out of a signal
    # handler may be raised where it is not let through.
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    driver = Driver()
    while not ended.is_set():
        rclpy.spin_once(driver, timeout_sec=0.1)
    rclpy.try_shutdown()  # your axes come to rest before this line
