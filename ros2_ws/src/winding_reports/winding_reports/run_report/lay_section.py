"""The report's section on the lay of a controlled run: verdict, turns, layers, pictures."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, MaxNLocator
from numpy.typing import NDArray

from winding_core.lay.errors import FIRST_JUDGED, FULL_TURN, TurnError, lay_errors, turn_state
from winding_core.lay.records import ControlBasis
from winding_core.units import MILLIMETRE
from winding_reports.documents.page import fixed
from winding_reports.documents.picture import (
    CORRECTED,
    FAINT,
    INK,
    PAPER,
    PREDICTED,
    TRACKED,
    Picture,
    broken,
    canvas,
    picture,
    thinned,
)
from winding_reports.records.lay_outcome import LaidLine, LayOutcome

Array = NDArray[np.float64]

_COLUMNS, _MOST = 3, 12
_HIGH = 2.6


def layers_picture(drum: Mapping[str, Any], predicted: LaidLine) -> Picture:
    """Return z over the angle around the drum, a panel for each of the newest layers.

    Args:
        drum: As `drum_outcome` returns it.
        predicted: The solver's cable at the end of the run.
    """
    layers = drum["layers"][-_MOST:]
    columns = min(_COLUMNS, len(layers))
    rows = -(-len(layers) // columns)
    low = {"low": 0.0, "high": drum["cable_diameter_m"] - drum["width_m"]}[drum["start_side"]]
    ends = np.array([low, low + drum["width_m"] - drum["cable_diameter_m"]]) / MILLIMETRE
    with canvas(_HIGH * rows + 0.4, rows=rows, columns=columns) as (figure, panels):
        for axes in panels[len(layers) :]:
            axes.set_visible(False)
        for layer, axes in zip(layers, panels, strict=False):
            _draw(axes, layer, drum["faults"], predicted)
            for end in ends:
                axes.axhline(end, color=FAINT, linewidth=0.8)
            axes.set_ylim(ends[0] - 0.1 * np.ptp(ends), ends[1] + 0.1 * np.ptp(ends))
        handles = panels[0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside lower center", ncols=4)
    return picture(
        figure,
        "The wound surface, unrolled by layer",
        "z in mm over the angle around the drum; lines at top and bottom are where cable lies "
        "against a flange. Rings are gaps, climbs and missing edge turns.",
    )


def _draw(
    axes: Axes, layer: Mapping[str, Any], faults: list[Mapping[str, Any]], predicted: LaidLine
) -> None:
    theta = np.array(layer["theta_rad"])
    wanted = np.array(layer["wanted_z_m"])
    inside = (predicted.theta >= theta[0]) & (predicted.theta <= theta[-1])
    solved = _unrolled(predicted.theta[inside], predicted.z[inside])
    measured = _unrolled(theta, np.array(layer["measured_z_m"], dtype=float))
    axes.plot(*_unrolled(theta, wanted), color=FAINT, linewidth=4.0, label="wanted")
    axes.plot(*solved, color=PREDICTED, linewidth=1.2, label="predicted in step")
    axes.plot(*measured, ".", color=TRACKED, markersize=4, label="measured")
    found = [fault for fault in faults if fault["layer"] == layer["number"]]
    at = np.array([fault["theta"] for fault in found], dtype=float)
    rings = _unrolled(at, np.interp(at, theta, wanted))
    label = "gap, climb or missing edge turn"
    axes.plot(*rings, "o", color=PAPER, markersize=11, markerfacecolor="none", label=label)
    share = layer["measured_share"]
    axes.set_title(f"layer {layer['number']}, {share:.0%} measured")
    axes.set_xlim(0.0, 360.0)
    axes.set_xticks([0, 90, 180, 270, 360])


def _unrolled(theta: Array, z: Array) -> tuple[Array, Array]:
    """Return angles around the drum [deg] and z [mm] of places, nan between turns."""
    angle = np.degrees(theta % FULL_TURN)
    ends = np.flatnonzero(np.diff(angle) < 0.0) + 1
    return np.insert(angle, ends, np.nan), np.insert(z / MILLIMETRE, ends, np.nan)


_BASES = {
    ControlBasis.MEASURED: "the measured lay",
    ControlBasis.MODEL: "the model, the tracker being lost",
    ControlBasis.RAMP: "the plain ramp, the solver being lost",
    ControlBasis.LATE: "the plain ramp, commands being late",
}
_MOST_NAMED = 24  # Of more turns every single one is no longer read off
# The lower picture shows so many tolerances; what is farther off is in the upper one.
_SHOWN_TOLERANCES = 4.0


@dataclass(frozen=True, kw_only=True)
class LaySection:
    """What the section shows."""

    verdict: str  # One sentence
    style: str  # kept, broken or open
    facts: dict[str, str]  # By name
    turns: list[list[str]]  # A row of texts for each turn
    landings: list[list[str]]  # A row of texts for each wanted marker
    pictures: list[Picture]  # Of the lay and of its turns


def lay_section(lay: LayOutcome) -> LaySection:
    """Return the section of a run's lay."""
    without = {turn.number: turn for turn in lay.without_turns}
    return LaySection(
        verdict=f"{lay.verdict.sentence[0].upper()}{lay.verdict.sentence[1:]}.",
        style={True: "kept", False: "broken", None: "open"}[lay.verdict.kept],
        facts=_facts(lay),
        turns=[_row(turn, without.get(turn.number), lay.verdict.tolerance) for turn in lay.turns],
        landings=[
            [
                f"P{landing.number}",
                fixed(landing.wanted, 4, FULL_TURN),
                fixed(landing.landed, 4, FULL_TURN),
                fixed(landing.landed - landing.wanted, 2, math.radians(1.0), sign="+"),
            ]
            for landing in lay.landings
        ],
        pictures=[
            outcome_picture(lay),
            *([turns_picture(lay)] if lay.turns else []),
            *([] if lay.drum is None else [layers_picture(lay.drum, lay.predicted)]),
        ],
    )


def _facts(lay: LayOutcome) -> dict[str, str]:
    achieved, without = lay.rms()
    facts = {
        "Controller": _mode(lay),
        "Commands rested on": ", ".join(
            f"{_BASES[basis]} {share:.0%}"
            for basis, share in lay.basis_shares.items()
            if share > 0.0
        ),
        "Guide held by a bound of the carriage": f"{lay.limited_share:.0%} of the run",
        "Free length, estimated": f"{lay.free_length / MILLIMETRE:.1f} ± "
        f"{lay.sigma_free_length / MILLIMETRE:.1f} mm",
        "Share of the pull, estimated": f"{lay.load_share:.3f} ± {lay.sigma_load_share:.3f}",
    }
    if math.isfinite(achieved) and math.isfinite(without):
        facts["After the second turn, rms"] = (
            f"{achieved / MILLIMETRE:.3f} mm, without control {without / MILLIMETRE:.2f} mm"
        )
    return facts


def _mode(lay: LayOutcome) -> str:
    """Return what the controller did in the end, and what it did of the run."""
    mode = lay.mode.name.lower()
    if 0.0 < lay.drive_share < 1.0:
        return f"{mode} in the end: it commanded {lay.drive_share:.0%} of the run"
    return f"{mode}: it commanded {'the machine' if lay.drove else 'nothing'}"


def _row(turn: TurnError, without: TurnError | None, tolerance: float) -> list[str]:
    return [
        str(turn.number),
        fixed(turn.wanted_z, 2, MILLIMETRE),
        fixed(turn.measured_z, 2, MILLIMETRE),
        fixed(turn.mean, 3, MILLIMETRE, sign="+"),
        fixed(turn.rms, 3, MILLIMETRE),
        fixed(turn.largest, 3, MILLIMETRE, sign="+"),
        fixed(turn.sigma_z, 2, MILLIMETRE),
        fixed(None if without is None else without.mean, 2, MILLIMETRE),
        turn_state(turn, tolerance),
    ]


def outcome_picture(lay: LayOutcome) -> Picture:
    """Return wanted, predicted and measured z over turns, and how far they are off."""
    with canvas(5.6, rows=2, heights=(3, 2)) as (figure, (above, below)):
        wanted = lay.wanted
        _line(above, wanted.theta, wanted.z, FAINT, 4.0, "wanted")
        _line(above, lay.without.theta, lay.without.z, PAPER, 1.2, "without control, lag law", "--")
        if lay.ahead.theta.size:
            above.scatter(
                lay.ahead.theta / FULL_TURN,
                lay.ahead.z / MILLIMETRE,
                marker="D",
                s=40,
                facecolors="none",
                edgecolors=PAPER,
                label="without control, solver before the run",
            )
        _line(above, lay.predicted.theta, lay.predicted.z, PREDICTED, 1.4, "predicted in step")
        _dots(above, lay.measured["theta"], lay.measured["z"], "measured")
        above.set_title("axial position z, mm")
        above.legend(loc="upper left")
        _tolerance_band(below, lay)
        below.axhline(0.0, color=FAINT, linewidth=0.8)
        predicted = lay.predicted.z - wanted.at(lay.predicted.theta)
        _line(below, lay.predicted.theta, predicted, PREDICTED, 1.4, "predicted in step")
        off = lay_errors(lay.measured, wanted)
        _dots(below, lay.measured["theta"], off, "measured")
        _set_height(below, lay, off)
        below.set_title("off the wanted lay, mm")
        below.set_xlabel("wound turns")
        for axes in (above, below):
            axes.set_xlim(0.0, max(wanted.end / FULL_TURN, 1.0e-3))
    limit = lay.verdict.tolerance / MILLIMETRE
    return picture(
        figure,
        "The lay that was wanted and the lay that was made",
        f"Dots are the places that the camera measured. The band is the tolerance of {limit:g} mm, "
        f"from turn {FIRST_JUDGED} on. Without control the guide would go along the wanted lay "
        "itself, at the paper's constant feed for an even helix, and the cable would land behind "
        "it by the lag of the estimated free length.",
    )


def turns_picture(lay: LayOutcome) -> Picture:
    """Return the largest error of every turn against the tolerance, and beside no control."""
    tolerance = lay.verdict.tolerance / MILLIMETRE
    with canvas(3.2, columns=2) as (figure, (achieved, both)):
        numbers = np.array([turn.number for turn in lay.turns], dtype=float)
        largest = np.array([abs(turn.largest) for turn in lay.turns]) / MILLIMETRE
        judged = numbers >= FIRST_JUDGED
        for chosen, colour, hatch, label in (
            (~judged, "none", "////", "not judged"),
            (judged & (largest <= tolerance), CORRECTED, "", "within"),
            (judged & (largest > tolerance), PAPER, "xx", "off"),
        ):
            if chosen.any():
                achieved.bar(
                    numbers[chosen],
                    largest[chosen],
                    width=0.6,
                    color=colour,
                    edgecolor=FAINT if colour == "none" else colour,
                    hatch=hatch,
                    label=label,
                )
        achieved.set_title("largest error of each turn, mm")
        without = {turn.number: abs(turn.largest) / MILLIMETRE for turn in lay.without_turns}
        before = np.array([without.get(int(number), math.nan) for number in numbers])
        both.bar(numbers - 0.2, before, width=0.38, color=PAPER, label="without control, lag law")
        both.bar(numbers + 0.2, largest, width=0.38, color=PREDICTED, label="achieved")
        both.set_yscale("log")
        both.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        both.set_title("the same before and after, mm, logarithmic")
        for axes in (achieved, both):
            axes.axhline(tolerance, color=INK, linewidth=1.0, linestyle="--")
            axes.set_xlabel("turn")
            axes.xaxis.set_major_locator(MaxNLocator(_MOST_NAMED, integer=True))
            axes.grid(visible=False, axis="x")
        figure.legend(loc="outside lower center", ncols=5)
    return picture(
        figure,
        "Every turn of the lay",
        f"The place that lies farthest off in each turn; dashed is the tolerance of "
        f"{tolerance:g} mm.",
    )


def _line(
    axes: Axes,
    theta: np.ndarray,
    z: np.ndarray,
    colour: str,
    width: float,
    label: str,
    style: str = "-",
) -> None:
    if len(theta):
        axes.plot(
            *thinned(theta / FULL_TURN, np.asarray(z) / MILLIMETRE),
            color=colour,
            linewidth=width,
            linestyle=style,
            label=label,
            solid_capstyle="butt",
        )


def _dots(axes: Axes, theta: np.ndarray, z: np.ndarray, label: str) -> None:
    if len(theta):
        turns, height = broken(np.asarray(theta) / FULL_TURN, np.asarray(z, float) / MILLIMETRE)
        axes.plot(turns, height, color=TRACKED, marker=".", markersize=4, linestyle="", label=label)


def _tolerance_band(axes: Axes, lay: LayOutcome) -> None:
    begin = float(FIRST_JUDGED - 1)
    end = lay.wanted.end / FULL_TURN
    if end > begin:
        limit = lay.verdict.tolerance / MILLIMETRE
        axes.fill_between([begin, end], -limit, limit, color=CORRECTED, alpha=0.15, linewidth=0.0)


def _set_height(axes: Axes, lay: LayOutcome, off: np.ndarray) -> None:
    """Show the band well, and what was measured in judged turns whole."""
    judged = lay.measured["theta"] >= FULL_TURN * (FIRST_JUDGED - 1)
    known = np.abs(off[judged & np.isfinite(off)])
    reach = 1.15 * max(known.max(initial=0.0), _SHOWN_TOLERANCES * lay.verdict.tolerance)
    axes.set_ylim(-reach / MILLIMETRE, reach / MILLIMETRE)
