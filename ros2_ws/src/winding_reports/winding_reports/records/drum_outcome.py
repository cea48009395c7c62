"""How a drum was filled: the unrolled surface layer by layer, and what was wrong with it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from winding_core.lay.layers import FULL_TURN, Layer, WoundDrum
from winding_core.lay.records import LayControlRecords, LayRecords

Array = NDArray[np.float64]

# Places of a turn on the unrolled surface.
PER_TURN = 24


def drum_outcome(
    wound: WoundDrum,
    control: LayControlRecords,
    places: LayRecords,
    faults: Sequence[Any],
) -> dict[str, Any]:
    """Return the unrolled surface of each layer as plain values, null where nothing is known.

    Args:
        wound: The drum as it was to be filled.
        control: States that the controller published, which say where the cable landed, shape (n,).
        places: Measured places, each as high as its layer, shape (m,).
        faults: What the controller found, as plain values.
    """
    order = np.unique(control["theta"], return_index=True)[1]
    landed = control["theta"][order], control["z"][order].astype(float)
    drum = wound.drum
    return {
        "width_m": drum.width,
        "flange_height_m": drum.flange_height,
        "start_side": drum.start_side,
        "winding": wound.winding,
        "pitch_m": wound.pitch,
        "cable_diameter_m": wound.cable_diameter,
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
        "number": layer.number,
        "radius_m": layer.radius,
        "direction": layer.direction,
        "first_turn": layer.first_turn,
        "last_turn": layer.last_turn,
        "measured_share": float(np.mean(np.isfinite(measured))),
        "theta_rad": theta.tolist(),
        "wanted_z_m": np.interp(theta, wound.theta, wound.z).tolist(),
        "landed_z_m": _known(estimated),
        "measured_z_m": _known(measured),
    }


def _known(values: Array) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in values.tolist()]
