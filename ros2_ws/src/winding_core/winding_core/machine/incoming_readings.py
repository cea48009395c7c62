"""Readings as they arrive: where a run begins, which tension belongs to each, which are refused."""

from collections import deque
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from winding_core.machine.axes import MachineAxes
from winding_core.machine.drive import PAPER_ANGULAR_SPEED, PAPER_FEED_SPEED
from winding_core.machine.readings import AxisReading

# Further from where it stood, an axis moves: above an encoder's noise, below a wound millimetre
# [rad, m].
MOTION = (2.0e-3, 1.0e-4)
STANDING = (0.02, 6.0e-5)  # Slower than this an axis stands, as its encoder sees it [rad/s, m/s]
LEAD_IN = 0.5  # So much standstill belongs to the run [s]


class Timed(Protocol):
    """Something that holds a reading and its time [s]."""

    @property
    def t(self) -> float:
        """Time of the reading [s]."""

    @property
    def reading(self) -> AxisReading:
        """Both axes."""


Item = TypeVar("Item", bound=Timed)


def has_moved(reading: AxisReading) -> bool:
    """Return whether an axis has left the origin, where the machine stood."""
    return abs(reading.cylinder_angle) > MOTION[0] or abs(reading.carriage_position) > MOTION[1]


def stands(reading: AxisReading) -> bool:
    """Return whether both axes are at rest, as far as their encoders can tell."""
    return abs(reading.angular_speed) < STANDING[0] and abs(reading.feed_speed) < STANDING[1]


class MotionStart(Generic[Item]):
    """Holds readings back until the machine moves; from then on everything passes."""

    def __init__(self, *, awaited: bool) -> None:
        self._awaited = awaited
        self._held: deque[Item] = deque()

    def passed(self, item: Item) -> tuple[Item, ...]:
        """Return what belongs to the run up to item, the last of the standstill included."""
        if not self._awaited:
            return (item,)
        self._held.append(item)
        while item.t - self._held[0].t > LEAD_IN:
            self._held.popleft()
        if not has_moved(item.reading):
            return ()
        self._awaited = False
        held, self._held = tuple(self._held), deque()
        return held


_ROUNDING = 1.0e-6  # Stamps are whole nanoseconds, carried as seconds


@dataclass(frozen=True, kw_only=True)
class LoadedReading:
    """An encoder reading at t [s] with the newest tension [N] that is not younger; None for none.

    None also stands for a load cell without a subscription.
    """

    t: float
    reading: AxisReading
    tension: float | None


class TensionPairing:
    """Holds readings until the load cell has caught up with them.

    Two topics arrive in any order, and the model must not depend on it: its result is the same
    whichever came first. A load cell that is silent for longer than `patience` is not waited
    for until it is heard again; its last value holds.

    Args:
        period: Of the load cell [s].
        patience: How far readings may run ahead of a silent load cell [s].
        listened: Whether tension matters at all.
    """

    def __init__(self, period: float, *, patience: float = 0.2, listened: bool = True) -> None:
        self._period = period
        self._patience = patience
        self._listened = listened
        self._readings: deque[tuple[float, AxisReading]] = deque()
        self._tensions: deque[tuple[float, float]] = deque()
        self._heard_until: float | None = None
        self._silent = not listened

    def add_tension(self, t: float, force: float) -> None:
        """Take a load cell's value [N]."""
        if not self._listened or (self._tensions and t <= self._tensions[-1][0]):
            return
        self._tensions.append((t, force))
        self._heard_until = t
        self._silent = False

    def add_reading(self, t: float, reading: AxisReading) -> None:
        """Take an encoder sample."""
        self._readings.append((t, reading))

    def ready(self) -> Iterator[LoadedReading]:
        """Yield the readings whose tension is known, or will not come in time."""
        while self._readings:
            t, reading = self._readings[0]
            if not self._covered(t):
                return
            self._readings.popleft()
            yield LoadedReading(t=t, reading=reading, tension=self._at(t))

    def _covered(self, t: float) -> bool:
        known = self._heard_until
        if self._silent or (known is not None and known > t - self._period + _ROUNDING):
            return True
        waited = self._readings[-1][0] - (t if known is None else max(known, t - self._period))
        self._silent = waited >= self._patience
        return self._silent

    def _at(self, t: float) -> float | None:
        while len(self._tensions) > 1 and self._tensions[1][0] <= t + _ROUNDING:
            self._tensions.popleft()
        if not self._tensions or self._tensions[0][0] > t + _ROUNDING:
            return None
        return self._tensions[0][1]


# Rounding of stamps and the encoder's own step, as a way of each axis [rad, m].
_SLACK = (0.02, 1.0e-4)


@dataclass(frozen=True, kw_only=True)
class ReadingLimits:
    """Limits of one run's readings, generous compared with a healthy machine."""

    weight: float  # Dead weight on the cable [N].
    angular_speed: float  # Full speed of the cylinder [rad/s]; the sign does not count.
    feed_speed: float  # Full speed of the carriage [m/s]; the sign does not count.
    tension_factor: float = 5.0  # Largest tension, as a share of the weight.
    speed_factor: float = 3.0  # Largest speed, as a share of full speed.

    def against_tension(self, force: float) -> str:
        """Return why a tension [N] cannot be, or nothing."""
        high = self.tension_factor * self.weight
        if force > high:
            return f"tension must be at most {high:.3g} N, got {force:.3g} N"
        return ""

    def against_motion(
        self, t: float, reading: AxisReading, before: tuple[float, AxisReading] | None
    ) -> str:
        """Return why a reading at t [s] cannot follow the one before it, or nothing."""
        # An axis that the programme lets stand may be moved by commands.
        axes = (
            ("cylinder", reading.angular_speed, abs(self.angular_speed) or PAPER_ANGULAR_SPEED),
            ("carriage", reading.feed_speed, abs(self.feed_speed) or PAPER_FEED_SPEED),
        )
        for name, speed, full in axes:
            if abs(speed) > self.speed_factor * full:
                return (
                    f"{name} must not be faster than {self.speed_factor * full:.3g}, "
                    f"got {speed:.3g}"
                )
        if before is None:
            return ""
        last_t, last = before
        ways = (
            reading.cylinder_angle - last.cylinder_angle,
            reading.carriage_position - last.carriage_position,
        )
        for (name, _, full), way, slack in zip(axes, ways, _SLACK, strict=True):
            reach = self.speed_factor * full * max(t - last_t, 0.0) + slack
            if abs(way) > reach:
                return f"{name} jumped by {way:.3g} within {t - last_t:.3g} s"
        return ""


def missing_joints(
    topic: str, names: Sequence[Collection[str]], seconds: float, axes: MachineAxes
) -> str:
    """Return what arrives where no message has both joints of a machine, or nothing.

    Args:
        topic: Where they arrive.
        names: Joints of each message.
        seconds: In how long they have arrived [s].
        axes: The machine's joints.
    """
    wanted = (axes.cylinder_joint, axes.carriage_joint)
    if not names or any(all(joint in heard for joint in wanted) for heard in names):
        return ""
    found = sorted({name for heard in names for name in heard})
    joints = f"joint{'s' * (len(found) != 1)} {', '.join(found)}" if found else "no joints"
    apart = len(found) > 1 and all(len(heard) == 1 for heard in names)
    what = (
        f"{len(names) / max(seconds, 1.0e-3):.0f} messages/s arrive on {topic} with {joints}"
        f"{', one in each' * apart}"
    )
    if set(wanted) <= set(found):
        return f"{what}; each message needs both {wanted[0]} and {wanted[1]}"
    return (
        f"{what}; configured are {wanted[0]} and {wanted[1]}: --cylinder-joint and "
        "--carriage-joint name others" + "; each message needs both" * apart
    )
