"""Folders of runs with made-up numbers, each `run.json` as its schema describes it."""

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

BEGIN = datetime(2026, 1, 5, 6, 0, tzinfo=UTC)


# Of a marker of a cable of its own, whose camera is not asked where it was seen.
NOT_KNOWN = (
    "theta_tracked_rad", "z_tracked_m", "sigma_theta_rad", "sigma_z_m", "h_held_out",
    "s_published_m", "error_held_out_pct",
)  # fmt: skip


def numbers(
    number: int,
    young: float | None = 3.1e6,
    *,
    error_pct: float = 1.0,
    young_stated_mpa: float = 3.0,
    verdict: str = "good",
    **labels: str,
) -> dict[str, Any]:
    """Return what a run leaves as `run.json`.

    Args:
        number: Of the run, one every hour.
        young: Identified modulus [Pa]; None for none.
        error_pct: Of the corrected length of its marker.
        young_stated_mpa: That was wound with.
        verdict: Of its outcome; failed and incomplete ones did not come to their end.
        labels: Of the run.
    """
    date = BEGIN + timedelta(hours=number)
    complete = verdict not in ("failed", "incomplete")
    good = {"good": True, "not good": False}.get(verdict)
    extent = {"turns": 5.4, "time_s": 20.0, "length_m": 0.58, "markers": 1}
    error = {"error_fem_pct": error_pct, "error_corrected_pct": error_pct}
    condition = {
        "cylinder_diameter_mm": 30.0, "cable_diameter_mm": 4.0, "young_mpa": young_stated_mpa,
        "duration_s": 20.0,
    }  # fmt: skip
    sentence = f"{verdict}: largest error {error_pct} %"
    content: dict[str, Any] = {
        "identity": {
            "run_id": f"run-{number:05d}",
            "date": date.strftime("%Y-%m-%dT%H:%M:%SZ"),
            "project_version": "0.1.0", "versions": {"python": "3.12"}, "host": "cell",
            "labels": {"cable": "hose", "machine": "left"} | labels,
            "seeds": [number], "bags": [], "weights": "rod", "weights_sha256": None,
            "condition": {
                name: {"value": value, "unit": "", "meaning": name}
                for name, value in condition.items()
            },
        },
        "case": 0,
        "outcome": {
            "verdict": verdict, "complete": complete, "cause": None, "machine": "standing",
            "ended_by": "completed" if complete else "signal",
            "asked": extent, "done": extent, "stops": [], "events": [], "losses": [],
            "sentences": [
                "completed: 5.40 turns" if complete else "ended by a signal after 2 turns",
                sentence,
            ],
        },
        "ended": None,
        "markers": [
            {
                "id": 1, "original_m": 0.1, "s_fem_m": 0.2, "h": 1.0, "s_corrected_m": 0.2, **error,
                "s_tracked_m": 0.2 * (1.0 + 0.01 * error_pct), **dict.fromkeys(NOT_KNOWN),
            }
        ],
        "frames": 4000, "frames_lost": 0, "joint_states": 20000, "joint_states_lost": 0,
        "wall_s": 20.5, "sim_s": 20.0,
        "error_verdict": {
            "good": good, "whole": complete, "sentence": sentence, "limit_pct": 4.8,
            "against": "camera", "largest_error_pct": error_pct, "marker": 1,
            "held_out_sentence": None, "largest_error_held_out_pct": None, "marker_held_out": None,
            "compared": [1], "helped": [], "worse": [],
            "markers": [{"id": 1, **error, "error_held_out_pct": None}],
        },
    }  # fmt: skip
    if young is not None:
        content["material"] = {
            "law": "linear", "young_pa": young, "standard_error_pa": 0.002 * young,
            "half_width_90_pa": 0.004 * young, "markers": [1], "taken_up": False, "refused": None,
        }  # fmt: skip
    return content


def write_run(folder: Path, content: dict[str, Any]) -> Path:
    (folder / "log").mkdir(parents=True)
    (folder / "run.json").write_text(json.dumps(content), encoding="utf-8")
    return folder
