"""Pictures of the machine during one run: speeds, tension, and where the graph's time went."""

import numpy as np
from numpy.typing import NDArray

from winding_core.units import MILLIMETRE, MILLINEWTON, MILLISECOND
from winding_reports.documents.picture import (
    FAINT,
    INK,
    PALE,
    PREDICTED,
    Picture,
    canvas,
    picture,
    thinned,
)
from winding_reports.records.run_record import AxisSpeeds, RunRecord, Signal
from winding_reports.trace import LengthTrace, hop_costs

# Long against the encoder's own beat, short against anything that a controller does slowly.
_SPEED_MEAN = 0.5
_TITLES = {
    "camera": "from the exposure of the newest frame, ms",
    "prediction": "from the encoder sample, ms",
}


def speeds_picture(record: AxisSpeeds) -> Picture:
    """Return both speeds against their targets, the paper's Figure 7, and what is between them."""
    drive = record.drive
    with canvas(4.6, rows=2, columns=2) as (figure, (cylinder, carriage, *gaps)):
        for axes, measured, setpoint, scale, label in (
            (cylinder, record.cylinder_speed, record.cylinder_setpoint, 1.0, "cylinder, rad/s"),
            (
                carriage,
                record.carriage_speed,
                record.carriage_setpoint,
                1.0 / MILLIMETRE,
                "carriage, mm/s",
            ),
        ):
            axes.plot(*_scaled(setpoint, scale), color=FAINT, linewidth=3.0, label="target")
            axes.plot(*_scaled(measured, scale), color=PREDICTED, linewidth=0.8, label="measured")
            axes.set_title(label)
            axes.legend(loc="lower right")
        for axes, measured, target in (
            (gaps[0], record.cylinder_speed, drive.angular_speed),
            (gaps[1], record.carriage_speed, drive.feed_speed),
        ):
            axes.axhline(0.0, color=FAINT, linewidth=0.8)
            held = measured.t >= drive.ramp_time
            if target > 0.0 and held.any():
                gap = 100.0 * (measured.value[held] / target - 1.0)
                t = measured.t[held]
                axes.plot(*thinned(t, gap), color=PALE, linewidth=0.6, label="samples")
                axes.plot(*_mean_over(t, gap, _SPEED_MEAN), color=PREDICTED, label="0.5 s mean")
                axes.legend(loc="upper right", ncols=2)
                axes.margins(y=0.25)
            axes.set_title("off target after the ramp, %")
            axes.set_xlabel("time, s")
        for axes in (cylinder, carriage, *gaps):
            axes.set_xlim(0.0, record.end)
    return picture(
        figure,
        "Speeds against their targets",
        "As the paper's Figure 7. After the ramp the cylinder is off its target by "
        f"{tracking(record.cylinder_speed, drive.angular_speed, drive.ramp_time)}, the carriage by "
        f"{tracking(record.carriage_speed, drive.feed_speed, drive.ramp_time)}.",
    )


def tracking(measured: Signal, target: float, ramp_time: float) -> str:
    """Return how closely a speed [rad/s or m/s] is held after the ramp [s], in words."""
    held = measured.value[measured.t >= ramp_time]
    if len(held) == 0 or target == 0.0:
        return "an unknown amount"
    rms = 100.0 * float(np.sqrt(np.mean((held / target - 1.0) ** 2)))
    peak = 100.0 * max(0.0, float(held.max()) / target - 1.0)
    return f"{rms:.2f} % rms (highest sample {peak:.1f} % above it)"


def tension_picture(record: RunRecord) -> Picture:
    """Return the load cell over time beside the dead weight."""
    weight = record.case.weight
    with canvas(2.3) as (figure, (axes,)):
        axes.axhline(weight, color=FAINT, linewidth=3.0, label="dead weight")
        axes.plot(*_scaled(record.tension, 1.0), color=PREDICTED, linewidth=0.8, label="load cell")
        axes.set_title("tension, N")
        axes.set_xlabel("time, s")
        axes.set_xlim(0.0, record.end)
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, 0.95 * weight), max(high, 1.05 * weight))
        axes.legend(loc="lower right", ncols=2)
    caption = "Force in the span between guide and cylinder; the axis does not begin at zero."
    if len(record.tension.value):
        caption += (
            f" Mean {record.tension.value.mean():.3f} N, standard deviation "
            f"{record.tension.value.std() / MILLINEWTON:.1f} mN."
        )
    return picture(figure, "Tension", caption)


def arm_picture(links: NDArray[np.float64], radius: float) -> Picture:
    """Return the arm at both ends of its way, along the cylinder's axis and from where cable lands.

    Args:
        links: Base, joints and eye in `winder_axis` [m], shape (2, points, 3).
        radius: Of the cylinder [m].
    """
    with canvas(3.4, columns=2) as (figure, (side, plan)):
        first, last = links / MILLIMETRE
        way = last[-1, 2] - first[-1, 2]
        circle = radius / MILLIMETRE * np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 73))
        side.fill(circle.imag, circle.real, color=FAINT)
        plan.fill_between(
            circle.imag[[18, 54]], -0.1 * way, 1.1 * way, color=FAINT, label="cylinder"
        )
        for points, colour, name in ((first, PALE, "start"), (last, PREDICTED, "end")):
            x, y, z = points.T
            side.plot(y, x, color=colour, marker="o", markersize=3.5)
            plan.plot(y, z, color=colour, marker="o", markersize=3.5, label=f"at the {name}")
            side.plot((y[-1], 0.0), (x[-1], x[-1]), color=INK, linewidth=0.8)
        side.set_title("along the axis: y and x, mm")
        plan.set_title("from where cable lands: y and z, mm")
        plan.legend(loc="lower left")
        for axes in (side, plan):
            axes.set_aspect("equal", adjustable="datalim")
    return picture(
        figure,
        "The arm",
        "Base, joints and eye of the arm that carried the guide, and the span from the eye to the "
        f"cylinder. The eye went {way:.1f} mm along the axis.",
    )


def _mean_over(t: np.ndarray, value: np.ndarray, span: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean of each stretch of `span` seconds, at its middle.

    A stretch with less than half of the usual samples, as the last one may be, has no mean.
    """
    bins = ((t - t[0]) / span).astype(int)
    count = np.bincount(bins)
    full = count >= 0.5 * np.median(count[count > 0])
    means = [np.bincount(bins, weights=column)[full] / count[full] for column in (t, value)]
    return means[0], means[1]


def _scaled(signal: Signal, scale: float) -> tuple[np.ndarray, np.ndarray]:
    return thinned(signal.t, scale * signal.value)


def trace_picture(trace: LengthTrace) -> Picture:
    """Return median and 99th percentile of each hop of both ways."""
    ways = [way for way in trace.ways if len(way.stamps)]
    heights = [len(way.hops) for way in ways] or [1]
    with canvas(0.8 + 0.21 * sum(heights), rows=len(heights), heights=heights) as (figure, rows):
        for axes, way in zip(rows, ways, strict=False):
            *hops, _whole = hop_costs(way)
            places = np.arange(len(hops))
            axes.barh(
                places, [hop.p99 / MILLISECOND for hop in hops], color=PALE, label="99th percentile"
            )
            axes.barh(
                places,
                [hop.median / MILLISECOND for hop in hops],
                height=0.45,
                color=PREDICTED,
                label="median",
            )
            axes.set_yticks(places, [f"{hop.station}: {hop.name}" for hop in hops])
            axes.invert_yaxis()
            axes.grid(visible=False, axis="y")
            axes.set_title(_TITLES[way.name])
            axes.legend(loc="lower right", ncols=2)
    wholes = [
        f"{whole.median / MILLISECOND:.1f} ms ({whole.p99 / MILLISECOND:.1f} ms) "
        f"{_TITLES[way.name].removesuffix(', ms')}"
        for way in ways
        for whole in hop_costs(way)[-1:]
    ]
    return picture(
        figure,
        "Where a corrected length's time goes",
        f"Median (99th percentile) of {trace.lengths} lengths: "
        f"{'; '.join(wholes) or 'none traced'}. The hops of a length add up to its whole.",
    )
