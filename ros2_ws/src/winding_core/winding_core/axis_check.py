"""Do the axes of a machine move as the condition says? A wrong sign or joint shows at once."""

from __future__ import annotations

from winding_core.drive import DriveProfile
from winding_core.readings import AxisReading

# A way that decides, of the cylinder [rad] and of the carriage [m].
_DECISIVE = (0.15, 5.0e-4)
# Another machine's speeds are its own business; another unit is further off than this.
_FACTOR = 5.0


def wrong_axis(reading: AxisReading, elapsed: float, drive: DriveProfile, lead: float = 0.0) -> str:
    """Return what is wrong with the axes of a machine that has just begun to wind, or nothing.

    Args:
        reading: Both axes, from where the machine stood.
        elapsed: Time since the first motion [s].
        drive: How the axes are expected to move.
        lead: Way by which a controlled carriage goes ahead of the cable besides [m].
    """
    angle, way = reading.cylinder_angle, reading.carriage_position
    expected_angle, expected_way = drive.positions(elapsed)
    slow = _FACTOR * max(abs(float(expected_way)), abs(float(expected_way) + lead))
    if abs(way) > max(_DECISIVE[0], slow) and abs(angle) < max(slow, _DECISIVE[1]):
        return (
            f"cylinder and carriage are swapped: the carriage moved {way:.3g} m while the cylinder "
            f"turned {angle:.3g} rad; exchange cylinder_joint and carriage_joint"
        )
    if angle < -_DECISIVE[0]:
        return (
            f"the cylinder turned backwards, by {angle:.3g} rad: its joint counts the other way "
            "(a negative cylinder_scale) or the machine unwinds"
        )
    if drive.feed_speed * way < 0.0 and lead * way <= 0.0 and abs(way) > _DECISIVE[1]:
        towards = "-z" if way < 0.0 else "+z"
        return (
            f"the carriage moved backwards, by {way:.3g} m: its joint counts the other way "
            f"(a negative carriage_scale) or the machine winds towards {towards}"
        )
    if angle > _DECISIVE[0] and angle > _FACTOR * float(expected_angle):
        return (
            f"the cylinder turned {angle:.3g} rad where {float(expected_angle):.3g} rad were "
            "expected: cylinder_scale must give radians"
        )
    if drive.feed_speed != 0.0 and abs(way) > max(_DECISIVE[1], slow):
        return (
            f"the carriage moved {way:.3g} m where {float(expected_way) + lead:.3g} m were "
            "expected: "
            "carriage_scale must give metres"
        )
    return ""
