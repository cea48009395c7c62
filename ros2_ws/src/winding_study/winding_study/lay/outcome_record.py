"""What became of a wanted lay, as JSON values."""

from __future__ import annotations

import math
from typing import Any

from winding_core.lay.errors import FIRST_JUDGED
from winding_study.lay.lay_outcome import LayOutcome


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
        "rms_m": _known(achieved),
        "without_control_rms_m": _known(without),
        "turns": [
            {
                "turn": turn.number,
                "judged": turn.number >= FIRST_JUDGED,
                "whole": turn.whole,
                "wanted_z_m": turn.wanted_z,
                "measured_z_m": turn.measured_z,
                "error_mean_m": turn.mean,
                "error_rms_m": turn.rms,
                "error_largest_m": turn.largest,
                "sigma_z_m": _known(turn.sigma_z),
                "without_control_error_mean_m": by_turn[turn.number].mean
                if turn.number in by_turn
                else None,
            }
            for turn in lay.turns
        ],
        "free_length_m": _known(lay.free_length),
        "sigma_free_length_m": _known(lay.sigma_free_length),
        "load_share": _known(lay.load_share),
        "sigma_load_share": _known(lay.sigma_load_share),
        "markers": [
            {
                "id": landing.number,
                "wanted_rad": landing.wanted,
                "landed_rad": _known(landing.landed),
                "error_rad": _known(landing.landed - landing.wanted),
            }
            for landing in lay.landings
        ],
        "basis_shares": {basis.name.lower(): share for basis, share in lay.basis_shares.items()},
        "limited_share": lay.limited_share,
        "drive_share": lay.drive_share,
    }


def _known(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
