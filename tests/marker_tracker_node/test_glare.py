"""Light that makes a part of a band white: unknown, neither marker nor background."""

import numpy as np
import pytest

from marker_tracker_node import ColourModel
from marker_tracker_node.detection.band import Band
from marker_tracker_node.detection.colour import Palette, colour_index
from marker_tracker_node.detection.colour_band import WHOLE_AREA, measure_band
from marker_tracker_node.detection.gate import HIDDEN, MEASURED, PARTLY, empty_gates
from marker_tracker_node.tracking.frame.gate_prediction import predict_gate

pytestmark = pytest.mark.slow

YELLOW = (25, 185, 225)
AZIMUTH = 0.05


@pytest.fixture(scope="module")
def model():
    paint = np.array(YELLOW) + 6.0 * np.random.default_rng(7).standard_normal((400, 3))
    return ColourModel.from_samples(np.clip(paint, 0, 255).astype(np.uint8))


@pytest.fixture(scope="module")
def seen(smooth_film, model):
    """A function that whitens a part of P0's picture and measures the band."""
    film = smooth_film(9)
    tracker = film.tracker()
    setup = tracker.config.setup(film.pinhole().view(tracker.config.pose))
    whole = film.frame_at(AZIMUTH)
    band = Band(AZIMUTH, 0.0, 0.0)

    def measure(white, level=255):
        gates = empty_gates(1)
        pixels = predict_gate(setup, band, gates, 0)
        rows, columns = np.indices(whole.shape[:2])
        away = np.stack([columns - gates.column[0], rows - gates.row[0]], axis=-1)
        # In lengths along and across the cable, from the middle of the band to its edge.
        along = (away @ [gates.along_u[0], gates.along_v[0]]) / gates.half_band[0]
        across = (away @ [-gates.along_v[0], gates.along_u[0]]) / gates.half_band[0]
        frame = whole.copy()
        frame[white(along, across)] = level
        picture = Palette.of(model, [50.0], 22.0).picture(frame)
        return measure_band(
            picture, setup.camera, setup.body, gates, 0, band, pixels, 1.0, WHOLE_AREA
        )

    return measure


def test_paint_under_white_light_is_unknown_and_grey_cable_is_not(model):
    glare = model.glare()
    for share, unknown in ((0.0, 0), (0.1, 0), (0.7, 1), (1.0, 1)):
        lit = np.minimum(np.array(YELLOW) + 255.0 * share, 255.0).astype(np.uint8)
        assert glare[colour_index(lit)] == unknown, share
    for grey in (90, 150, 230):
        assert glare[colour_index(np.full(3, grey, np.uint8))] == 0, grey


def test_a_band_without_glare_is_measured_as_a_whole(seen):
    found = seen(lambda along, across: np.zeros(along.shape, bool))
    assert found.outcome == MEASURED
    assert found.completeness == 1.0


@pytest.mark.parametrize(
    "white",
    [
        pytest.param(lambda along, across: np.abs(across) < 0.4, id="stripe along the cable"),
        pytest.param(lambda along, across: along > 0.2, id="one end"),
        pytest.param(lambda along, across: across > 0.2, id="one flank"),
        pytest.param(lambda along, across: np.abs(along + across) < 0.5, id="slanting"),
        pytest.param(
            lambda along, across: (np.abs(along - 0.6) < 0.2) | (np.abs(along + 0.4) < 0.2),
            id="two stripes",
        ),
    ],
)
def test_what_is_seen_of_a_band_gives_its_middle(seen, white):
    whole, found = seen(lambda along, across: np.zeros(along.shape, bool)), seen(white)
    assert found.outcome == PARTLY
    assert found.completeness < 0.85
    # The plain mean of what is left would be up to 40 mrad and 0.5 mm off. Where an edge is left on
    # one side only it is known to half a pixel, 3.5 mrad and 0.12 mm.
    assert found.azimuth == pytest.approx(whole.azimuth, abs=4.0e-3)
    assert found.z == pytest.approx(whole.z, abs=0.12e-3)


def test_the_deviation_grows_where_an_end_is_hidden_and_not_where_none_is(seen):
    end = seen(lambda along, across: along > 0.2)
    flank = seen(lambda along, across: across > 0.2)
    assert end.azimuth_factor > 1.3
    assert flank.z_factor > 1.3


def test_a_band_of_which_no_end_is_known_is_hidden(seen):
    assert seen(lambda along, across: np.abs(along) > 0.5).outcome == HIDDEN


def test_something_grey_before_a_band_hides_it_still(seen):
    assert seen(lambda along, across: along > 0.2, 150).outcome == HIDDEN
