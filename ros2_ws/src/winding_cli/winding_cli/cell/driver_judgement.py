"""What a machine's driver must provide, judged on what it published: no ROS in here."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from winding_core.units import MILLISECOND

Array = NDArray[np.float64]

LOWEST_ENCODER_RATE_HZ = 40.0  # Slower encoders leave too much of a ramp between two samples
# The tracker interpolates the encoder over at most this gap.
LONGEST_GAP_S = 0.1
LOWEST_TENSION_RATE_HZ = 50.0
LOWEST_FRAME_RATE_HZ = 25.0
CLOCK_TOLERANCE_S = 0.25  # Predictions, frames and encoder are put together by their stamps
STANDSTILL_SHARE = 0.01  # Share of the running speed below which an axis stands
# Speed is compared with the change of position, which an encoder's steps make coarse.
SPEED_TOLERANCE = 0.2


@dataclass(frozen=True)
class Finding:
    """One promise of the interface and whether it was kept."""

    promise: str  # What was asked
    measured: str  # What was seen, in words and numbers
    kept: bool = field(kw_only=True)  # Whether it was


@dataclass(kw_only=True)
class Heard:
    """What was received on one topic."""

    stamps: list[float] = field(default_factory=list)  # Stamp of each message [s]
    arrived: list[float] = field(default_factory=list)  # When it came, by the system's clock [s]
    # Content of each message; joint states as (angle [rad], angular speed [rad/s], carriage
    # position [m], feed speed [m/s]), tension as (force [N],), others empty.
    values: list[tuple[float, ...]] = field(default_factory=list)
    # One sentence for each message that could not be decoded.
    refused: list[str] = field(default_factory=list)


def judge_stream(name: str, heard: Heard, lowest_rate: float) -> Iterator[Finding]:
    """Yield findings on one topic: messages can be read, stamps run forward, often enough."""
    stamps = np.array(heard.stamps)
    yield Finding(
        f"{name}: every message can be read",
        heard.refused[0] if heard.refused else f"{len(stamps)} messages",
        kept=not heard.refused and len(stamps) > 0,
    )
    if len(stamps) < 2:
        return
    steps = np.diff(stamps)
    backwards = int((steps <= 0.0).sum())
    yield Finding(
        f"{name}: stamps increase", f"{backwards} of {len(steps)} do not", kept=backwards == 0
    )
    rate = float((len(stamps) - 1) / max(stamps[-1] - stamps[0], 1.0e-9))
    # As printed: a camera of exactly that rate is not distinguished by its clock's last digits.
    kept = round(rate, 1) >= lowest_rate
    yield Finding(f"{name}: at least {lowest_rate:g} Hz by its stamps", f"{rate:.1f} Hz", kept=kept)


def judge_encoder(heard: Heard) -> Iterator[Finding]:
    """Yield findings on rig/joint_states beyond those of any stream."""
    stamps, values = np.array(heard.stamps), np.array(heard.values)
    if len(stamps) < 3:
        return
    gap = float(np.diff(stamps).max())
    yield Finding(
        f"rig/joint_states: no gap above {LONGEST_GAP_S / MILLISECOND:g} ms",
        f"largest {gap / MILLISECOND:.1f} ms",
        kept=round(gap / MILLISECOND, 1) <= LONGEST_GAP_S / MILLISECOND,
    )
    span = stamps[-1] - stamps[0]
    for name, position, velocity, unit in (("cylinder", 0, 1, "rad/s"), ("carriage", 2, 3, "m/s")):
        moved = float(values[-1, position] - values[0, position]) / span
        speed = values[:, velocity]
        reported = float(np.diff(stamps) @ (0.5 * (speed[1:] + speed[:-1]))) / span
        largest = max(abs(moved), abs(reported))
        yield Finding(
            f"rig/joint_states: {name} velocity is the rate of its position",
            f"position moves {moved:.4g} {unit}, velocity reports {reported:.4g} {unit}",
            kept=largest == 0.0 or abs(moved - reported) <= SPEED_TOLERANCE * largest,
        )


def judge_tension(heard: Heard) -> Iterator[Finding]:
    """Yield findings on rig/tension beyond those of any stream."""
    force = np.array([value[0] for value in heard.values])
    if len(force):
        yield Finding(
            "rig/tension: force.x pulls, in newton",
            f"{force.min():.3f} to {force.max():.3f} N",
            kept=bool((force > 0.0).all()),
        )


def judge_camera(
    images: Heard, infos: Heard, encoder: Heard, topic: str = "camera/image_raw"
) -> Iterator[Finding]:
    """Yield findings on the frames of a topic.

    Each must have its calibration, and lie within the encoder's samples.
    """
    frames, calibrations = set(images.stamps), set(infos.stamps)
    # Of the two topics one is heard first, and the newest message may be ahead of its partner.
    begin = max(min(frames, default=0.0), min(calibrations, default=0.0))
    open_end = max(frames | calibrations, default=0.0)
    alone = {t for t in frames ^ calibrations if begin <= t < open_end}
    yield Finding(
        "camera/camera_info: one for each frame, with its stamp",
        f"{len(alone)} of {len(frames)} frames differ",
        kept=bool(frames and calibrations) and not alone,
    )
    if encoder.stamps and images.stamps:
        first, last = encoder.stamps[0], encoder.stamps[-1]
        earliest, latest = first - CLOCK_TOLERANCE_S, last + CLOCK_TOLERANCE_S
        outside = [t for t in images.stamps if not earliest <= t <= latest]
        lead = camera_lead(images, encoder)
        yield Finding(
            f"{topic}: stamped at exposure by the encoder's clock",
            f"{len(outside)} of {len(images.stamps)} frames lie outside"
            + ("" if lead is None else f"; {lead.sentence}"),
            kept=not outside and (lead is None or lead.least <= _EARLY),
        )


# What arrives so much before the instant of its stamp may be a matter of two clocks' reading [s].
_EARLY = 2.0e-3
# Periods for which a frame may be on its way: exposed and read out, sent and taken.
_PERIODS_ON_THE_WAY = 2.0


@dataclass(frozen=True, kw_only=True)
class CameraLead:
    """How far the camera's clock is ahead of the encoder's, by when frames arrive."""

    least: float  # If frames took no time at all [s]
    period: float  # Of the frames [s]

    @property
    def offset(self) -> float:
        """If frames were on their way for one period [s]."""
        return self.least + 0.5 * _PERIODS_ON_THE_WAY * self.period

    @property
    def error(self) -> float:
        """What the offset is known to, if frames are on their way for two periods at most [s]."""
        return 0.5 * _PERIODS_ON_THE_WAY * self.period

    @property
    def sentence(self) -> str:
        """The offset, and what follows from it."""
        ahead = self.offset / MILLISECOND
        text = (
            f"the camera's clock is {ahead:+.1f} +- {self.error / MILLISECOND:.1f} ms ahead of the "
            f"encoder's where frames take up to {_PERIODS_ON_THE_WAY:g} periods to arrive"
        )
        if self.least > _EARLY:
            text += (
                f": they arrive {self.least / MILLISECOND:.1f} ms before the instants of their "
                "stamps; mend them, or run with --camera-clock-correction"
            )
        return text


def camera_lead(images: Heard, encoder: Heard) -> CameraLead | None:
    """Return how far the camera's clock is ahead; None where too little has arrived.

    Of each topic the quickest messages count: the others have waited. An encoder whose messages
    arrive soon after their stamps stamps by the system's clock, and the camera is held against
    that; otherwise against the encoder's quickest messages, at the pace of its clock: a film or
    a simulation may be slower than the system's.
    """
    if min(len(images.arrived), len(encoder.arrived)) < 3:
        return None
    late = float(np.percentile(np.subtract(encoder.arrived, encoder.stamps), 5.0))
    if 0.0 <= late < CLOCK_TOLERANCE_S:
        least = -float(np.percentile(np.subtract(images.arrived, images.stamps), 5.0))
    else:
        pace, origin = _pace(encoder), encoder.stamps[0]
        reference, camera = (
            np.percentile(np.asarray(heard.arrived) - pace * (np.asarray(heard.stamps) - origin), 5)
            for heard in (encoder, images)
        )
        least = float(reference - camera) / pace
    return CameraLead(least=least, period=float(np.median(np.abs(np.diff(images.stamps)))))


def _pace(heard: Heard) -> float:
    """Return how much of the system's time passes in a second of the stamps [s/s]."""
    third = max(len(heard.stamps) // 3, 1)
    arrived, stamps = (
        float(np.median(times[-third:]) - np.median(times[:third]))
        for times in (heard.arrived, heard.stamps)
    )
    return arrived / stamps if stamps > 0.0 < arrived else 1.0


def judge_clock(streams: Sequence[Heard]) -> Finding:
    """Return whether the newest stamps of all topics agree."""
    newest = [heard.stamps[-1] for heard in streams if heard.stamps]
    apart = max(newest) - min(newest) if newest else 0.0
    return Finding(
        f"all topics: stamps from one clock, within {CLOCK_TOLERANCE_S:g} s",
        f"{apart:.3f} s apart",
        kept=bool(newest) and apart <= CLOCK_TOLERANCE_S,
    )


def stands(value: tuple[float, ...], running: tuple[float, float]) -> bool:
    """Return whether both axes stand, given (angle, speed, position, feed) and running speeds."""
    speeds = zip((value[1], value[3]), running, strict=True)
    return all(abs(speed) <= STANDSTILL_SHARE * abs(usual) for speed, usual in speeds)


def runs(value: tuple[float, ...], running: tuple[float, float]) -> bool:
    """Return whether both axes wind at half their running speed [rad/s, m/s] or more."""
    return value[1] >= 0.5 * running[0] and value[3] >= 0.5 * running[1]
