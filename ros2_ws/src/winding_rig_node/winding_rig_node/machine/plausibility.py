"""Do readings fit the machine? Invalid ones are refused; a persistent misfit stops the machine."""

import math
from collections import Counter
from dataclasses import dataclass

from winding_core.units import MILLISECOND

# Share of full speed from which an axis must count, and how many counts it may be behind.
_TURNING, _COUNTS = 0.1, 2.0


@dataclass(frozen=True, kw_only=True)
class AxisLimits:
    """What one axis can do."""

    name: str  # As a sentence names it
    full_speed: float  # Speed of the run [rad/s or m/s]
    resolution: float  # Way per count of the encoder [rad or m]
    cogging: float = 0.0  # Speed that the motor's cogging is worth [rad/s or m/s]


@dataclass(frozen=True, kw_only=True)
class PlausibilityConfig:
    """Limits of the machine's sensors."""

    axes: tuple[AxisLimits, ...]  # Cylinder and carriage
    weight: float  # Dead weight on the cable [N]
    patience: float = 0.05  # How long a limit may be exceeded [s]
    overspeed: float = 1.5  # Largest speed, as a share of full speed
    # Largest difference between measured speed and commanded speed, or the speed that the motor's
    # voltage stands for, as a share of full speed. Twelve healthy cases stay below 0.05.
    disagreement: float = 0.25
    low_tension: float = 0.2  # Smallest tension, as a share of the weight
    high_tension: float = 3.0  # Largest tension, as a share of the weight
    # How long a load cell may repeat one value [s]; noise moves a healthy one.
    still_tension: float = 0.3


@dataclass(frozen=True, kw_only=True)
class AxisObservation:
    """One axis at one moment, in its own units per second."""

    commanded: float  # Speed setpoint
    measured: float  # Speed that the encoder gives
    modelled: float  # Speed that the motor's voltage stands for


class Plausibility:
    """Judges the sensors of the machine while it moves."""

    def __init__(self, config: PlausibilityConfig) -> None:
        self.config = config
        self.refused: Counter[str] = Counter()  # Values that could not be, by sensor
        self._accepted: dict[str, tuple[float, float]] = {}
        self._moved: dict[str, float] = {}
        self._left: dict[str, float] = {}  # Where it was then
        self._since: dict[str, float] = {}
        self._heard: dict[str, float] = {}
        self._force = math.nan

    def begin(self, t: float) -> None:
        """Forget what lasted: the machine begins to move at t [s]."""
        self._since.clear()
        for name in (*(axis.name for axis in self.config.axes), "load cell"):
            self._heard[name] = t
        for axis in self.config.axes:
            self._moved[axis.name] = t
            if axis.name in self._accepted:
                self._accepted[axis.name] = (t, self._accepted[axis.name][1])

    def forget(self) -> None:
        """Take the next positions as they come: the axes are at a new start."""
        self._accepted.clear()
        self._since.clear()

    def position(self, axis: int, t: float, value: float | None) -> float | None:
        """Return an encoder's position [rad or m] at time t [s] if it can be, else None."""
        limits = self.config.axes[axis]
        if value is None:
            return None
        last_t, last = self._accepted.get(limits.name, (t, value))
        # An axis cannot have gone further than it can run, a few counts aside.
        reach = self.config.overspeed * limits.full_speed * (t - last_t) * 2.0
        if not math.isfinite(value) or abs(value - last) > reach + 10.0 * limits.resolution:
            self.refused[f"{limits.name} encoder"] += 1
            return None
        if abs(value - self._left.setdefault(limits.name, value)) >= 0.5 * limits.resolution:
            self._moved[limits.name], self._left[limits.name] = t, value
        self._accepted[limits.name] = (t, value)
        self._heard[limits.name] = t
        return value

    def tension(self, t: float, force: float | None) -> float | None:
        """Return a load cell's force [N] if it is a number, else None."""
        if force is None:
            return None
        if not math.isfinite(force):
            self.refused["load cell"] += 1
            return None
        self._heard["load cell"] = t
        self._note("still", t, violated=force == self._force)
        self._force = force
        low = self.config.low_tension * self.config.weight
        high = self.config.high_tension * self.config.weight
        self._note("tension", t, violated=not low <= force <= high)
        return force

    def verdict(self, t: float, observations: tuple[AxisObservation, ...]) -> str | None:
        """Return why the machine has to be stopped at t [s], or None."""
        patience = self.config.patience
        for limits, seen in zip(self.config.axes, observations, strict=True):
            reason = self._axis_verdict(t, limits, seen)
            if reason is not None:
                return f"{limits.name} encoder {reason} for more than {patience / MILLISECOND:g} ms"
        if t - self._heard.get("load cell", t) > patience:
            return f"load cell gives no valid reading for more than {patience / MILLISECOND:g} ms"
        if t - self._since.get("still", t) > self.config.still_tension:
            return (
                f"load cell is stuck for more than {self.config.still_tension / MILLISECOND:g} ms"
            )
        if self._lasts("tension", t):
            return (
                f"tension is outside {self.config.low_tension * self.config.weight:.3g} to "
                f"{self.config.high_tension * self.config.weight:.3g} N for more than "
                f"{patience / MILLISECOND:g} ms"
            )
        return None

    def _axis_verdict(self, t: float, limits: AxisLimits, seen: AxisObservation) -> str | None:
        full, name = limits.full_speed, limits.name
        turning = abs(seen.commanded) > _TURNING * full
        if not turning:
            self._moved[name] = t
        small = 0.05 * full
        against = seen.commanded * seen.measured < 0.0
        # A slow axis is held up and let go by its motor's cogging, by twice that before it is even.
        uneven = 2.0 * limits.cogging
        apart = max(self.config.disagreement * full, uneven)
        checks = (
            (
                "counts against the commanded direction",
                against and min(abs(seen.commanded), abs(seen.measured)) > small,
            ),
            (
                "counts faster than the axis can run",
                abs(seen.measured) > max(self.config.overspeed * full, full + uneven),
            ),
            ("does not follow the setpoint", abs(seen.measured - seen.commanded) > apart),
            ("does not agree with the motor's voltage", abs(seen.measured - seen.modelled) > apart),
        )
        for text, violated in checks:
            self._note(f"{name} {text}", t, violated=violated)
        if t - self._heard.get(name, t) > self.config.patience:
            return "gives no valid reading"
        # At the slowest speed that is judged so many counts take longer where the axis is slow.
        counts = _COUNTS * limits.resolution / (_TURNING * full)
        if t - self._moved.get(name, t) > self.config.patience + counts:
            return "is stuck"
        for text, _ in checks:
            if self._lasts(f"{name} {text}", t):
                return text
        return None

    def _note(self, what: str, t: float, *, violated: bool) -> None:
        if violated:
            self._since.setdefault(what, t)
        else:
            self._since.pop(what, None)

    def _lasts(self, what: str, t: float) -> bool:
        return t - self._since.get(what, t) > self.config.patience
