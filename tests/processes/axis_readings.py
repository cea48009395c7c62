"""Readings of both axes, of which a test names what matters to it."""

from winding_core.machine.readings import AxisReading


def axis_reading(
    angle: float = 0.0, guide: float = 0.0, speed: float = 0.0, feed: float = 0.0
) -> AxisReading:
    """Return where cylinder [rad] and guide [m] stand and how they move [rad/s, m/s]."""
    return AxisReading(
        cylinder_angle=angle, angular_speed=speed, carriage_position=guide, feed_speed=feed
    )
