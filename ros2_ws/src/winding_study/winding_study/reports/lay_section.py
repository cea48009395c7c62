"""The report's section on the lay of a controlled run."""

from __future__ import annotations

import math
from dataclasses import dataclass

from winding_core.lay.errors import FULL_TURN, TurnError, turn_state
from winding_core.lay.records import ControlBasis
from winding_core.units import MILLIMETRE
from winding_study.documents.page import MISSING
from winding_study.documents.picture import Picture
from winding_study.lay.lay_outcome import LayOutcome
from winding_study.reports.outcome_pictures import outcome_picture, turns_picture

_BASES = {
    ControlBasis.MEASURED: "the measured lay",
    ControlBasis.MODEL: "the model, the tracker being lost",
    ControlBasis.RAMP: "the plain ramp, the solver being lost",
}


@dataclass(frozen=True, kw_only=True)
class LaySection:
    """What the section shows.

    Attributes:
        verdict: One sentence.
        style: kept, broken or open.
        facts: By name.
        turns: A row of texts for each turn.
        landings: A row of texts for each wanted marker.
        pictures: Of the lay and of its turns.
    """

    verdict: str
    style: str
    facts: dict[str, str]
    turns: list[list[str]]
    landings: list[list[str]]
    pictures: list[Picture]


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
                _turns(landing.wanted),
                _turns(landing.landed),
                _degrees(landing.landed - landing.wanted),
            ]
            for landing in lay.landings
        ],
        pictures=[outcome_picture(lay), *([turns_picture(lay)] if lay.turns else [])],
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
        f"{turn.wanted_z / MILLIMETRE:.2f}",
        f"{turn.measured_z / MILLIMETRE:.2f}",
        _signed(turn.mean),
        f"{turn.rms / MILLIMETRE:.3f}",
        _signed(turn.largest),
        f"{turn.sigma_z / MILLIMETRE:.2f}",
        MISSING if without is None else f"{without.mean / MILLIMETRE:.2f}",
        turn_state(turn, tolerance),
    ]


def _signed(value: float) -> str:
    # Minus zero is noise.
    return f"{round(value / MILLIMETRE, 3) + 0.0:+.3f}"


def _turns(angle: float) -> str:
    return f"{angle / FULL_TURN:.4f}" if math.isfinite(angle) else MISSING


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):+.2f}" if math.isfinite(angle) else MISSING
