"""Faults that can be put into a signal on purpose, to see what the rest makes of them."""

import math
from collections import deque
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

Values = NDArray[Any]


class FaultError(ValueError):
    """A fault is not known, not enabled, or cannot have this amount."""


class FaultKind(Enum):
    """What is wrong with a signal."""

    OFF = "off"
    STUCK = "stuck"
    GARBAGE = "garbage"
    WRONG = "wrong"
    SLOW = "slow"
    DELAYED = "delayed"
    INTERMITTENT = "intermittent"


@dataclass(frozen=True, kw_only=True)
class _Amount:
    default: float
    low: float
    high: float
    meaning: str


_AMOUNTS = {
    FaultKind.WRONG: _Amount(default=2.0, low=-1e6, high=1e6, meaning="factor"),
    FaultKind.SLOW: _Amount(default=10.0, low=2.0, high=1e6, meaning="one value in so many"),
    FaultKind.DELAYED: _Amount(default=0.1, low=0.001, high=10.0, meaning="delay [s]"),
    FaultKind.INTERMITTENT: _Amount(default=0.2, low=0.0, high=1.0, meaning="share lost"),
}
# Garbage on a number; a number that cannot be is a wrong factor.
_GARBAGE = (math.nan, math.inf, -math.inf)


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One fault of one signal."""

    target: str  # Name of the signal
    kind: FaultKind  # What is wrong
    # Factor, one value in so many, delay [s] or share lost; 0 for a kind without one.
    amount: float = 0.0


def parse_faults(text: str, targets: Collection[str]) -> tuple[Fault, ...]:
    """Return the faults of `target:kind[:amount]`, separated by commas; none for an empty text.

    Raises:
        FaultError: An unknown target or kind, a target twice, or an amount out of range.
    """
    faults = tuple(_parse_one(part.strip(), targets) for part in text.split(",") if part.strip())
    names = [fault.target for fault in faults]
    for name in names:
        if names.count(name) > 1:
            raise FaultError(f"{name} is given two faults; a signal has one at a time")
    return faults


def _parse_one(text: str, targets: Collection[str]) -> Fault:
    target, *rest = text.split(":")
    if target not in targets:
        raise FaultError(f"no signal {target!r}; there are {', '.join(sorted(targets))}")
    if len(rest) not in (1, 2):
        raise FaultError(f"a fault is written target:kind or target:kind:amount, got {text!r}")
    kinds = {kind.value: kind for kind in FaultKind}
    if rest[0] not in kinds:
        raise FaultError(f"no fault {rest[0]!r}; there are {', '.join(kinds)}")
    kind = kinds[rest[0]]
    limits = _AMOUNTS.get(kind)
    if limits is None:
        if len(rest) == 2:
            raise FaultError(f"fault {kind.value} has no amount, got {rest[1]!r}")
        return Fault(target=target, kind=kind)
    try:
        amount = float(rest[1]) if len(rest) == 2 else limits.default
    except ValueError:
        raise FaultError(f"the amount of {kind.value} must be a number, got {rest[1]!r}") from None
    if not limits.low <= amount <= limits.high:
        raise FaultError(
            f"the amount of {kind.value} ({limits.meaning}) must be {limits.low:g} to "
            f"{limits.high:g}, got {amount:g}"
        )
    return Fault(target=target, kind=kind, amount=amount)


@dataclass(frozen=True, kw_only=True)
class Delivery:
    """What comes out of a signal at one moment: `values`, and the time `t` that they claim [s]."""

    t: float
    values: Values


class FaultyChannel:
    """A signal with one fault in it."""

    def __init__(self, fault: Fault, rng: np.random.Generator) -> None:
        self.fault = fault
        self._rng = rng
        self._taken = 0
        self._held: Values | None = None
        self._waiting: deque[Delivery] = deque()

    def deliver(self, t: float, values: Values) -> tuple[Delivery, ...]:
        """Put in the true values of time t [s]; return what comes out now, oldest first."""
        kind, amount = self.fault.kind, self.fault.amount
        self._taken += 1
        now = Delivery(t=t, values=values)
        if kind is FaultKind.OFF:
            return ()
        if kind is FaultKind.STUCK:
            self._held = values.copy() if self._held is None else self._held
            return (Delivery(t=t, values=self._held),)
        if kind is FaultKind.GARBAGE:
            return (Delivery(t=t, values=self._garbage(values)),)
        if kind is FaultKind.WRONG:
            return (Delivery(t=t, values=_scaled(values, amount)),)
        if kind is FaultKind.SLOW:
            return (now,) if (self._taken - 1) % round(amount) == 0 else ()
        if kind is FaultKind.INTERMITTENT:
            return () if self._rng.random() < amount else (now,)
        self._waiting.append(Delivery(t=t, values=values.copy()))
        due = []
        while self._waiting and self._waiting[0].t <= t - amount + 1.0e-9:
            due.append(self._waiting.popleft())
        return tuple(due)

    def _garbage(self, values: Values) -> Values:
        if values.dtype.kind == "f":
            return self._rng.choice(_GARBAGE, values.shape)
        limits = np.iinfo(values.dtype)
        return self._rng.integers(limits.min, limits.max, values.shape, values.dtype, endpoint=True)


class Faults:
    """The faults that are in the machine's signals now, by signal."""

    def __init__(self, faults: Collection[Fault] = (), *, seed: int = 0) -> None:
        self._channels: Mapping[str, FaultyChannel] = {
            fault.target: FaultyChannel(fault, np.random.default_rng([seed, index]))
            for index, fault in enumerate(faults)
        }

    def __bool__(self) -> bool:
        return bool(self._channels)

    def of(self, target: str) -> FaultyChannel | None:
        """Return the channel of a signal that has a fault, or None."""
        return self._channels.get(target)

    def through(self, target: str, t: float, value: float) -> float | None:
        """Return a sensor's reading in place of `value` at time t [s]; None when it is silent."""
        channel = self._channels.get(target)
        if channel is None:
            return value
        delivered = channel.deliver(t, np.array([value]))
        return float(delivered[-1].values[0]) if delivered else None


def _scaled(values: Values, factor: float) -> Values:
    scaled: Values = values * np.float64(factor)
    if values.dtype.kind == "f":
        return scaled
    limits = np.iinfo(values.dtype)
    return np.clip(scaled, limits.min, limits.max).astype(values.dtype)
