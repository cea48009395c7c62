"""The truth of a run as a JSON file, for evaluation after the run."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from winding_core.lay.layers import FULL_TURN
from winding_rig_node.lay.lay_law import LayTruth

FloatArray = NDArray[np.float64]


def truth_record(truth: LayTruth) -> dict[str, Any]:
    """Return a truth as JSON values.

    Keys: `hidden` (what `HiddenRig` holds; empty for a lay that is known ahead), `wound_angle`
    [rad], `path` (`theta` [rad], `z` [m], `length` [m], the last one empty for a lay that is
    known ahead; on a drum `radius` [m], `layer` from 1 on the drum and `turn` from 1 at P0, empty
    on a bare cylinder) and `markers` (`theta` [rad], `z` [m], null for those that have not landed).
    """
    return {
        "hidden": dict(truth.hidden),
        "wound_angle": truth.wound_angle,
        "path": {
            "theta": truth.theta.tolist(),
            "z": truth.z.tolist(),
            "length": truth.length.tolist(),
            "radius": truth.radius.tolist(),
            "layer": truth.layer.tolist(),
            "turn": (truth.theta[: truth.layer.size] // FULL_TURN + 1).astype(int).tolist(),
        },
        "markers": {"theta": _numbers(truth.marker_theta), "z": _numbers(truth.marker_z)},
    }


def truth_path(name: str) -> Path | None:
    """Return the file that a truth shall be written to; None for an empty name.

    Raises:
        ValueError: There is no folder for it.
    """
    if not name:
        return None
    file = Path(name)
    if file.is_dir() or not file.parent.is_dir():
        raise ValueError(f"truth_file must name a file in a folder that exists, got {name!r}")
    return file


def write_truth(file: Path, record: Mapping[str, Any]) -> None:
    """Write a truth as JSON; a reader sees the old file or the new one, unless it is a device.

    Raises:
        OSError: The file cannot be written.
    """
    text = json.dumps(record, allow_nan=False)
    if file.exists() and not file.is_file():
        file.write_text(text, encoding="utf-8")
        return
    part = file.with_name(f"{file.name}.part")
    part.write_text(text, encoding="utf-8")
    part.replace(file)


def _numbers(values: FloatArray) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in values]
