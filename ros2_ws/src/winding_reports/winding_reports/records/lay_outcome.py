"""What became of a wanted lay, beside a run without control, and how a drum was filled."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.condition import ResolvedCondition
from winding_core.lay.errors import (
    FIRST_JUDGED,
    LayVerdict,
    TurnError,
    WantedLine,
    judge,
    turn_errors,
)
from winding_core.lay.guide_path import lay_of
from winding_core.lay.layers import FULL_TURN, Layer, WoundDrum
from winding_core.lay.records import (
    LAY_DTYPE,
    ControlBasis,
    ControlMode,
    LayControlRecords,
    LayRecords,
)
from winding_core.units import json_values, known

Array = NDArray[np.float64]

PER_TURN = 24  # Places of a turn on the unrolled surface


def drum_outcome(
    wound: WoundDrum, control: LayControlRecords, places: LayRecords, faults: Sequence[Any]
) -> dict[str, Any]:
    """Return the unrolled surface of each layer as plain values, null where nothing is known.

    Args:
        wound: The drum as it was to be filled.
        control: States of the controller, with the place of the landed cable, shape (n,).
        places: Measured places, each as high as its layer, shape (m,).
        faults: What the controller found, as plain values.
    """
    order = np.unique(control["theta"], return_index=True)[1]
    landed = control["theta"][order], control["z"][order].astype(float)
    drum = wound.drum
    return {
        **json_values(drum, "width_m", "flange_height_m", "start_side"),
        **json_values(wound, "winding", "pitch_m", "cable_diameter_m"),
        "faults": list(faults),
        "layers": [_layer(layer, wound, landed, places) for layer in wound.layers],
    }


def _layer(
    layer: Layer, wound: WoundDrum, landed: tuple[Array, Array], places: LayRecords
) -> dict[str, Any]:
    first, last = layer.first_turn * FULL_TURN, layer.last_turn * FULL_TURN
    step = FULL_TURN / PER_TURN
    theta = first + step * (np.arange(max(round((last - first) / step), 1)) + 0.5)
    measured = np.full(theta.shape, np.nan)
    own = places[(places["theta"] >= first) & (places["theta"] < last)]
    at = np.minimum(((own["theta"] - first) / step).astype(int), theta.size - 1)
    for k in np.unique(at):
        measured[k] = float(own["z"][at == k].mean())
    estimated = np.interp(theta, *landed, left=np.nan, right=np.nan)
    return {
        **json_values(layer, "number", "radius_m", "direction", "first_turn", "last_turn"),
        "measured_share": float(np.mean(np.isfinite(measured))),
        "theta_rad": theta.tolist(),
        "wanted_z_m": np.interp(theta, wound.theta, wound.z).tolist(),
        "landed_z_m": [*map(known, estimated)],
        "measured_z_m": [*map(known, measured)],
    }


_STEP = 0.02
_SAME = 1.0e-4  # A wanted lay that is no farther from the drive programme's helix is that helix [m]


@dataclass(frozen=True, kw_only=True)
class LaidLine:
    """Where cable lies."""

    theta: Array  # Wound angles, ascending [rad], shape (n,)
    z: Array  # There [m], shape (n,)


@dataclass(frozen=True, kw_only=True)
class Landing:
    """A marker that was wanted somewhere."""

    number: int  # n of Pn
    wanted: float  # Wound angle at which it was wanted [rad]
    landed: float  # Mean over all frames that show it [rad]; nan where none does


@dataclass(frozen=True, kw_only=True)
class LayOutcome:
    """A controlled run's lay."""

    mode: ControlMode  # What the controller did in the end
    wanted: WantedLine  # Where the cable was wanted, as the controller followed it
    measured: LayRecords  # Places of the wound cable, LAY_DTYPE, ascending
    predicted: LaidLine  # The solver's cable at the end of the run
    # Without control, by the lag law with the estimated free length: the guide goes along the
    # wanted lay itself, which for an even helix is the paper's constant feed.
    without: LaidLine
    # The solver's markers before the run, under the drive programme; empty where another lay was
    # wanted.
    ahead: LaidLine
    turns: tuple[TurnError, ...]  # Error of every measured turn
    without_turns: tuple[TurnError, ...]  # The same of `without`
    verdict: LayVerdict  # Against the tolerance
    free_length: float  # Estimated at the end [m]
    sigma_free_length: float  # One standard deviation of it [m]
    load_share: float  # Estimated share of the pull that reaches the cylinder
    sigma_load_share: float  # One standard deviation of it
    landings: tuple[Landing, ...]  # Markers that were wanted somewhere
    # Share of the run that commands rested on each basis.
    basis_shares: Mapping[ControlBasis, float]
    limited_share: float  # Share of the run in which a bound of the carriage held the guide
    drive_share: float  # Share of the run in which the controller commanded the machine
    # How a drum was filled, see `drum_outcome`; None on a bare cylinder.
    drum: Mapping[str, Any] | None = None

    @property
    def drove(self) -> bool:
        """Whether the verdict is one on the controller."""
        return self.mode is ControlMode.DRIVE

    def rms(self) -> tuple[float, float]:
        """Return rms of the turns after the second [m], achieved and without control; nan if none.

        Turns count by their places.
        """
        return _rms(self.turns), _rms(self.without_turns)


@dataclass(frozen=True, kw_only=True)
class LaidRun:
    """What a run left of its lay."""

    # States that the controller published, LAY_CONTROL_DTYPE, shape (n,), n > 0.
    control: LayControlRecords
    places: LayRecords  # The last measured lay, LAY_DTYPE
    predicted: LaidLine  # The solver's cable at the end of the run
    ahead: LaidLine  # Markers that the solver predicted before the run
    landed: Mapping[int, float]  # Measured wound angle of markers [rad], by number


def lay_outcome(
    run: LaidRun, what: ResolvedCondition, *, tolerance: float, markers: Mapping[int, float]
) -> LayOutcome:
    """Return what became of a run's lay.

    Args:
        run: What it left.
        what: The condition.
        tolerance: For every turn after the second [m].
        markers: Wound angle at which a marker was wanted [rad], by number.
    """
    control = run.control
    last = control[-1]
    wanted = WantedLine.recorded(control)
    places = run.places[np.argsort(run.places["theta"])]
    turns = turn_errors(places, wanted)
    radius = what.case.centreline_radius
    without = _without_control(wanted, float(last["free_length"]) / radius)
    bases = control["basis"]
    return LayOutcome(
        mode=ControlMode(int(last["mode"])),
        wanted=wanted,
        measured=places,
        predicted=run.predicted,
        without=without,
        ahead=_same_helix(run.ahead, wanted, what.drive.advance_per_radian),
        turns=turns,
        without_turns=turn_errors(_as_places(without), wanted),
        verdict=judge(turns, tolerance, wanted.end),
        free_length=float(last["free_length"]),
        sigma_free_length=float(last["sigma_free_length"]),
        load_share=float(last["load_share"]),
        sigma_load_share=float(last["sigma_load_share"]),
        landings=tuple(
            Landing(number=number, wanted=angle, landed=run.landed.get(number, math.nan))
            for number, angle in sorted(markers.items())
            if angle <= wanted.end
        ),
        basis_shares={basis: float(np.mean(bases == int(basis))) for basis in ControlBasis},
        limited_share=float(np.mean(control["limited"] > 0)),
        drive_share=float(np.mean(control["mode"] == int(ControlMode.DRIVE))),
    )


def _without_control(wanted: WantedLine, lag: float) -> LaidLine:
    if not wanted.end > 0.0:
        return LaidLine(theta=np.zeros(0), z=np.zeros(0))
    theta = np.linspace(0.0, wanted.end, math.ceil(wanted.end / _STEP) + 1)
    # A controller that was started in mid-run knows nothing of the helix before.
    guide = np.interp(theta, wanted.theta, wanted.z)
    return LaidLine(theta=theta, z=lay_of(theta, guide, lag))


def _same_helix(ahead: LaidLine, wanted: WantedLine, advance: float) -> LaidLine:
    """Return what was predicted under the drive programme, if that is what was wanted."""
    inside = (ahead.theta > 0.0) & (ahead.theta <= wanted.end)
    theta, z = ahead.theta[inside], ahead.z[inside]
    same = theta.size and np.abs(wanted.at(theta) - advance * theta).max() < _SAME
    return LaidLine(theta=theta, z=z) if same else LaidLine(theta=np.zeros(0), z=np.zeros(0))


def _as_places(line: LaidLine) -> LayRecords:
    places = np.zeros(line.theta.size, LAY_DTYPE)
    places["theta"], places["z"] = line.theta, line.z
    places["turn"] = line.theta // FULL_TURN
    return places


def _rms(turns: tuple[TurnError, ...]) -> float:
    judged = [turn for turn in turns if turn.number >= FIRST_JUDGED]
    count = sum(turn.places for turn in judged)
    if not count:
        return math.nan
    return math.sqrt(sum(turn.places * turn.rms**2 for turn in judged) / count)


def outcome_json(lay: LayOutcome) -> dict[str, Any]:
    """Return the figures of a lay in SI units; null where nothing is known."""
    achieved, without = lay.rms()
    by_turn = {turn.number: turn for turn in lay.without_turns}
    return {
        "mode": lay.mode.name.lower(),
        "tolerance_m": lay.verdict.tolerance,
        "first_judged_turn": FIRST_JUDGED,
        "kept": lay.verdict.kept,
        "verdict": lay.verdict.sentence,
        "rms_m": known(achieved),
        "without_control_rms_m": known(without),
        "turns": [
            {
                "turn": turn.number,
                "judged": turn.number >= FIRST_JUDGED,
                "error_mean_m": turn.mean,
                "error_rms_m": turn.rms,
                "error_largest_m": turn.largest,
                **json_values(turn, "whole", "wanted_z_m", "measured_z_m", "sigma_z_m"),
                "without_control_error_mean_m": by_turn[turn.number].mean
                if turn.number in by_turn
                else None,
            }
            for turn in lay.turns
        ],
        **json_values(lay, "free_length_m", "sigma_free_length_m"),
        **json_values(lay, "load_share", "sigma_load_share"),
        "markers": [
            {
                "id": landing.number,
                "wanted_rad": landing.wanted,
                "landed_rad": known(landing.landed),
                "error_rad": known(landing.landed - landing.wanted),
            }
            for landing in lay.landings
        ],
        "basis_shares": {basis.name.lower(): share for basis, share in lay.basis_shares.items()},
        **json_values(lay, "limited_share", "drive_share"),
        **({} if lay.drum is None else {"drum": dict(lay.drum)}),
    }
