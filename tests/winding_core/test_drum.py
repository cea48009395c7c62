"""Cable on a drum: layers touch, nothing passes a flange, and the totals are closed forms."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from winding_core.lay.drum_parameters import DrumWinding
from winding_core.lay.layers import WIDEST_PITCH, WINDINGS, layer_rise
from winding_core.machine.drum import Drum, DrumError

TURN = 2.0 * math.pi
D = 3.0e-3
DRUM = Drum(radius=0.02, width=0.04, flange_height=0.02)


def test_turns_in_valleys_touch_both_neighbours_below() -> None:
    for pitch in np.linspace(D, 1.7 * D, 8):
        rise = layer_rise("parallel", D, float(pitch))
        assert math.hypot(rise, 0.5 * pitch) == pytest.approx(D, rel=1e-12)
        # Nor does the next layer but one lie in the first.
        assert 2.0 * rise > D


def test_layers_of_close_pitch_rise_by_root_three_radii() -> None:
    wound = DrumWinding().wind(DRUM, D, layers=5)
    wanted = DRUM.radius + 0.5 * D + np.arange(5) * math.sqrt(3.0) * 0.5 * D
    assert wound.radii == pytest.approx(wanted, rel=1e-12)
    assert wound.filled_diameter == pytest.approx(2.0 * wanted[-1] + D, rel=1e-12)


@pytest.mark.parametrize("pitch", [1.0, 1.1, 1.2, 1.3])
def test_crossing_layers_rise_by_the_mean_over_their_way_across(pitch: float) -> None:
    p = pitch * D
    mean = 2.0 / p * quad(lambda u: math.sqrt(D**2 - u**2), 0.0, 0.5 * p)[0]
    assert layer_rise("cross", D, p) == pytest.approx(mean, rel=1e-12)
    assert layer_rise("parallel", D, p) < mean < D


def test_a_crossing_turn_lies_on_the_nearest_turn_of_the_opposite_helix() -> None:
    pitch, below = 1.2 * D, 0.02
    theta = np.linspace(0.0, TURN, 100_001)
    upper, lower = below - pitch * theta / TURN, pitch * theta / TURN
    from_nearest = (upper - lower + 0.5 * pitch) % pitch - 0.5 * pitch
    resting = np.sqrt(D**2 - from_nearest**2)
    # The trapezoid of a smooth function with two kinks: the square of the step.
    assert layer_rise("cross", D, pitch) == pytest.approx(np.mean(resting), rel=1e-5)
    assert np.ptp(resting) == pytest.approx(0.2 * D, rel=1e-4)


@pytest.mark.parametrize("winding", ["parallel", "cross"])
def test_a_layer_is_as_long_as_its_turns_and_its_dwell(winding: str) -> None:
    pitch, dwell = 1.2 * D, 0.4 * TURN
    wound = DrumWinding(winding=winding, pitch=pitch, edge_dwell=dwell).wind(DRUM, D, layers=4)
    turns = (DRUM.width - D) / pitch
    rho = wound.radii
    wanted = turns * np.hypot(TURN * rho, pitch) + rho * dwell * np.array([1.0, 1.0, 1.0, 0.0])
    assert wound.lengths == pytest.approx(wanted, rel=1e-12)
    assert wound.turns == pytest.approx(4.0 * turns + 3.0 * 0.4, rel=1e-12)


def test_an_orthocyclic_layer_is_as_long_as_its_turns_at_rest_and_its_crossings() -> None:
    share = 0.3
    wound = DrumWinding(crossing_share=share).wind(DRUM, D, layers=2)
    rho = wound.radii[0]
    rest, across = TURN * rho * (1.0 - share), TURN * rho * share
    # Thirteen turns, twelve crossings of a pitch and one of half a pitch back into the valley.
    wanted = 13.0 * rest + 12.0 * math.hypot(across, D) + math.hypot(across, 0.5 * D)
    assert wound.lengths[0] == pytest.approx(wanted, rel=1e-12)
    # The even helix of the same turns is shorter by less than its climb over the crossing's share.
    even = 13.0 * math.hypot(TURN * rho, D)
    assert abs(wound.lengths[0] / even - 1.0) < (D / (TURN * rho)) ** 2 / (2.0 * share)


def test_mass_and_inertia_are_those_of_a_hollow_cylinder_of_the_same_cable() -> None:
    drum = Drum(radius=0.02, width=0.2, flange_height=0.06)
    wound = DrumWinding().wind(drum, 1.0e-3, layers=40)
    mass = wound.mass(0.01)
    assert mass == pytest.approx(0.01 * wound.length, rel=1e-12)
    # Each layer stands for a shell as thick as layers are apart.
    half = 0.25 * math.sqrt(3.0) * 1.0e-3
    inner, outer = wound.radii[0] - half, wound.radii[-1] + half
    # Layers of 200 and 199 turns in turn, which is worth a share of 1 / 400 of the outermost.
    assert wound.inertia(0.01) == pytest.approx(0.5 * mass * (inner**2 + outer**2), rel=2.5e-3)
    assert wound.inertia(np.full(40, 0.01)) == pytest.approx(wound.inertia(0.01), rel=1e-12)


@settings(max_examples=60, deadline=None)
@given(
    winding=st.sampled_from(WINDINGS),
    pitch=st.floats(1.0, 1.3),
    width=st.floats(2.4, 40.0),
    layers=st.integers(1, 6),
    dwell=st.floats(0.0, 1.0),
    share=st.floats(0.05, 0.95),
    side=st.sampled_from(["low", "high"]),
)
def test_the_program_stays_between_the_flanges_and_on_its_layers(
    winding: str, pitch: float, width: float, layers: int, dwell: float, share: float, side: str
) -> None:
    drum = Drum(radius=0.02, width=width * D, flange_height=7.0 * D, start_side=side)
    how = DrumWinding(
        winding=winding, pitch=pitch * D, crossing_share=share, edge_dwell=dwell * TURN
    )
    wound = how.wind(drum, D, layers=layers)
    program = wound.program()
    place = drum.sign * program.z
    assert place.min() >= -1e-12
    assert place.max() <= drum.width - D + 1e-12
    assert np.unique(program.raised).size == layers
    assert [layer.direction for layer in wound.layers] == [
        int(drum.sign) * (-1) ** k for k in range(layers)
    ]
    # Within its traverse neighbours of a layer never lie closer than the pitch.
    for layer in wound.layers:
        turns = layer.direction * np.diff(layer.z)
        assert (turns[:-1] >= pitch * D * (1.0 - 1e-9)).all()
    if winding == "orthocyclic" and layers > 1:
        offset = (wound.layers[1].z[:, None] - wound.layers[0].z) / (pitch * D)
        # Every turn lies in the middle between two places of the layer below.
        assert offset % 1.0 == pytest.approx(0.5, abs=1e-6)


@settings(max_examples=30, deadline=None)
@given(winding=st.sampled_from(WINDINGS), share=st.floats(0.01, 1.0))
def test_a_length_ends_where_it_is_wound_up(winding: str, share: float) -> None:
    how = DrumWinding(winding=winding)
    full = how.wind(DRUM, D, layers=5)
    wound = how.wind(DRUM, D, length=share * full.length)
    assert wound.length == pytest.approx(share * full.length, rel=1e-9)
    before = wound.theta[:-1]
    assert wound.z[:-1] == pytest.approx(np.interp(before, full.theta, full.z), abs=1e-12)


def test_where_half_a_pitch_is_left_all_layers_are_as_wide() -> None:
    narrow = DrumWinding().wind(Drum(radius=0.02, width=10.0 * D, flange_height=0.02), D, layers=3)
    wide = DrumWinding().wind(Drum(radius=0.02, width=10.5 * D, flange_height=0.02), D, layers=3)
    assert [layer.z.size for layer in narrow.layers] == [10, 9, 10]
    assert [layer.z.size for layer in wide.layers] == [10, 10, 10]


def test_grooves_give_their_pitch() -> None:
    drum = Drum(radius=0.02, width=0.04, flange_height=0.02, groove_pitch=1.15 * D)
    assert DrumWinding(winding="parallel").wind(drum, D, layers=1).pitch == 1.15 * D


@pytest.mark.parametrize(
    ("drum", "how", "much", "sentence"),
    [
        ({"width": -1.0}, {}, {}, "the drum's width must be positive and finite, got -1000 mm"),
        ({"groove_pitch": 0.0}, {}, {}, "groove pitch must be positive and finite, got 0 mm"),
        ({"start_side": "left"}, {}, {}, "must be low or high, got 'left'"),
        ({}, {"winding": "wild"}, {}, "one of orthocyclic, parallel, cross, got 'wild'"),
        ({}, {"crossing_share": 1.0}, {}, "between 0 and 1, got 1"),
        ({}, {"edge_dwell": 7.0}, {}, "0 to 1 turn, after which the cable would climb"),
        ({}, {}, {}, "layers or a length"),
        ({}, {}, {"layers": 1, "length": 1.0}, "layers or a length"),
        ({}, {}, {"layers": 0}, "layers must be at least 1, got 0"),
        ({}, {}, {"length": math.nan}, "the length must be positive and finite, got nan m"),
        ({}, {"pitch": 2.0e-3}, {"layers": 1}, "not the cable's diameter of 3 mm or more"),
        ({}, {"pitch": math.nan}, {"layers": 1}, "a pitch of nan mm is not the cable's diameter"),
        ({}, {"pitch": 5.4e-3}, {"layers": 2}, "no wider than 1.7 diameters, 5.1 mm"),
        ({}, {"pitch": 4.0e-3, "winding": "cross"}, {"layers": 2}, "1.3 diameters, 3.9 mm"),
        ({"width": 5.0e-3}, {}, {"layers": 1}, "no room for two turns"),
        ({"groove_pitch": 3.3e-3}, {"pitch": 3.0e-3}, {"layers": 1}, "leaves the drum's grooves"),
        ({"flange_height": 2.0e-3}, {}, {"layers": 1}, "2 mm high hold no layer of a cable of 3"),
        ({}, {}, {"layers": 9}, "9 layers would pass the flanges, 20 mm high: they hold 7 layers"),
        ({}, {}, {"length": 30.0}, "30 m of cable would pass the flanges"),
        ({"width": 80.0}, {}, {"layers": 2}, "at most 10000 turns"),
    ],
)
def test_what_leaves_the_drum_is_refused(
    drum: dict[str, Any], how: dict[str, Any], much: dict[str, Any], sentence: str
) -> None:
    sizes = {"radius": 0.02, "width": 0.04, "flange_height": 0.02}
    with pytest.raises(DrumError, match=sentence):
        DrumWinding(**how).wind(Drum(**(sizes | drum)), D, **much)


def test_flanges_that_are_as_high_as_a_refusal_asks_hold_the_layers() -> None:
    with pytest.raises(DrumError, match=r"9 layers need 23\.78 mm"):
        DrumWinding().wind(DRUM, D, layers=9)
    higher = Drum(radius=0.02, width=0.04, flange_height=0.02379)
    assert len(DrumWinding().wind(higher, D, layers=9).layers) == 9


@pytest.mark.parametrize("winding", WINDINGS)
def test_the_widest_pitch_is_taken(winding: str) -> None:
    assert layer_rise(winding, D, WIDEST_PITCH[winding] * D) > 0.5 * D
