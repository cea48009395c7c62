"""The truth of a run, for who judges it afterwards."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from winding_rig_node.lay.driven_lay import DrivenLay
from winding_rig_node.lay.known_lay import CableLay

FloatArray = NDArray[np.float64]


def truth_of(lay: CableLay | DrivenLay, turned: float) -> dict[str, Any]:
    """Return where the cable lies, and what the rig did to it, as JSON values.

    Keys: `hidden` (what `HiddenRig` holds; empty for a lay that is known ahead), `wound_angle`
    [rad], `path` (`theta` [rad], `z` [m], `length` [m], the last one empty for a lay that is
    known ahead) and `markers` (`theta` [rad], `z` [m], null for those that have not landed).

    Args:
        lay: The lay.
        turned: Wound angle of the cylinder [rad]; a lay that is known ahead ends there.
    """
    hidden: Mapping[str, float] = {}
    if isinstance(lay, DrivenLay):
        hidden = asdict(lay.hidden)
        theta = np.append(lay.path.theta, lay.wound_angle)
        z, length = lay.z_at(theta), lay.length_at(theta)
        marker_theta, turned = lay.marker_theta, lay.wound_angle
        marker_z = lay.z_at(marker_theta)
    else:
        theta = lay.path_theta[lay.path_theta <= turned]
        z, length = lay.path_z[: theta.size], np.empty(0)
        marker_theta = np.where(lay.marker_theta <= turned, lay.marker_theta, np.nan)
        marker_z = np.interp(marker_theta, lay.path_theta, lay.path_z)
    return {
        "hidden": dict(hidden),
        "wound_angle": turned,
        "path": {"theta": theta.tolist(), "z": z.tolist(), "length": length.tolist()},
        "markers": {"theta": _numbers(marker_theta), "z": _numbers(marker_z)},
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
