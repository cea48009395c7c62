"""The unrolled surface of a drum: what was wanted, where it landed, and what was seen of it."""

import json
import math

import numpy as np
import pytest

from winding_core.lay.drum_parameters import DrumWinding
from winding_core.lay.records import LAY_CONTROL_DTYPE, LAY_DTYPE, LayRecords
from winding_core.machine.drum import Drum
from winding_reports.records.lay_outcome import PER_TURN, drum_outcome

D = 4.0e-3
TURN = 2.0 * math.pi
WOUND = DrumWinding(pitch=1.05 * D).wind(
    Drum(radius=0.03, width=0.026, flange_height=0.02), D, layers=3
)
OFF = 2.0e-4


def seen(theta: np.ndarray, lift: np.ndarray) -> LayRecords:
    places = np.zeros(theta.size, LAY_DTYPE)
    places["theta"], places["lift"] = theta, lift
    places["z"] = np.interp(theta, WOUND.theta, WOUND.z) + OFF
    return places


def test_each_layer_has_its_places_and_says_how_much_of_it_was_measured() -> None:
    landed = np.arange(0.0, 0.6 * WOUND.theta[-1], 0.03)
    control = np.zeros(landed.size, LAY_CONTROL_DTYPE)
    control["theta"], control["z"] = landed, np.interp(landed, WOUND.theta, WOUND.z)
    first = np.arange(0.0, WOUND.layers[0].last_turn * TURN, 0.05)
    places = WOUND.in_place(
        seen(first, np.zeros(first.size)), np.interp(first, WOUND.theta, WOUND.z)
    )
    found = drum_outcome(WOUND, control, places, [{"kind": "gap"}])
    assert json.loads(json.dumps(found)) == found
    one, two, three = found["layers"]
    assert len(one["theta_rad"]) == round(PER_TURN * WOUND.layers[0].last_turn)
    assert (one["measured_share"], two["measured_share"]) == (1.0, 0.0)
    assert set(three["landed_z_m"]) == {None}
    off = np.array(one["measured_z_m"]) - np.array(one["wanted_z_m"])
    # Places of a crossing are means over a step of it.
    assert np.median(off) == pytest.approx(OFF, rel=0.01)
    assert [layer["radius_m"] for layer in found["layers"]] == WOUND.radii.tolist()


def test_places_at_another_height_or_of_another_turn_are_left_out() -> None:
    theta = np.linspace(WOUND.layers[1].first_turn * TURN + 1.0, WOUND.theta[-1] - 1.0, 50)
    right = WOUND.program().raised_at(theta)
    landed = np.interp(theta, WOUND.theta, WOUND.z)
    assert WOUND.in_place(seen(theta, right), landed).size == theta.size
    assert WOUND.in_place(seen(theta, right + 0.5 * D), landed).size == 0
    assert WOUND.in_place(seen(theta, right), landed + 2.0 * WOUND.pitch).size == 0
