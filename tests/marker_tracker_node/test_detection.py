"""What one mark looks like: its colour, the band model, the detector, and light on it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from marker_film import photograph

from marker_tracker_node import CameraPose, ColourModel, ColourRefusedError
from marker_tracker_node.camera.pinhole import pixel_of_plane
from marker_tracker_node.detection.band import Band, band_centroid, solve_band
from marker_tracker_node.detection.colour import Palette, colour_index
from marker_tracker_node.detection.colour_band import WHOLE_AREA
from marker_tracker_node.detection.colour_band import measure as measure_mark
from marker_tracker_node.detection.gate import HIDDEN, MEASURED, PARTLY, empty_gates
from marker_tracker_node.tracking.frame.gate_prediction import axis_scale, guarded, predict_gate
from winding_rig_node.camera import CablePath, CameraConfig, Window

# Every sensor pixel around the middle of the cylinder's first turn.
CLOSE = Window(x_offset=200, y_offset=300, width=400, height=700, binning=1)
SHARP = replace(CameraConfig(), window=CLOSE, supersampling=6)
PAINT = (25, 185, 225)
AZIMUTH = 0.05
RNG = np.random.default_rng(7)
YELLOW = (30, 190, 225)
BRASS = (70, 150, 180)


def view_and_body(film):
    config = film.tracker().config
    return film.pinhole().view(CameraPose(position=film.camera.position)), config.body


@pytest.mark.slow
@pytest.mark.parametrize("case", [1, 3, 5, 9])
def test_centroid_and_area_agree_with_the_renderers_ground_truth(smooth_film, case):
    film = smooth_film(case, camera=SHARP)
    view, body = view_and_body(film)
    for azimuth in (0.0, 0.35, 1.0):
        level = CablePath(theta=film.path.theta, z=np.zeros_like(film.path.z))
        made = film.scene(azimuth, 0.0, path=level)
        truth = film.renderer.visible_bands(made)[0]
        a, b, area = band_centroid(view, body, Band(azimuth, 0.0, 0.0))
        # 0.05 px is 4 um; the sections of the renderer are chords of 3 px.
        np.testing.assert_allclose(pixel_of_plane(view, a, b), truth["centroid"], atol=0.05)
        assert area * view.fx * view.fy == pytest.approx(truth["area"], rel=0.01)


def test_solving_inverts_the_model(smooth_film):
    view, body = view_and_body(smooth_film(3))
    for azimuth in (-0.3, -0.05, 0.0, 0.2, 0.6, 1.05):
        a, b, _ = band_centroid(view, body, Band(azimuth, 0.031, 1.5e-3))
        found, z = solve_band(view, body, a, b, Band(azimuth + 0.05, 0.032, 1.5e-3))
        # The fixed point stops at changes of 2e-6 rad and contracts by at least two.
        assert found == pytest.approx(azimuth, abs=4e-6)
        assert z == pytest.approx(0.031, abs=1e-7)


@pytest.mark.slow
def test_a_touching_turn_hides_what_the_renderer_hides(smooth_film):
    film = smooth_film(4, camera=SHARP)
    view, body = view_and_body(film)
    pitch = 2.0 * body.cable_radius
    slope = pitch / (2.0 * math.pi)
    touching = CablePath(theta=film.path.theta, z=slope * film.path.theta)
    theta = film.theta[1]
    # A turn after it has landed, a third of a right angle and more to the side.
    azimuth = 2.0 * math.pi + 1.0
    truth = film.renderer.visible_bands(film.scene(theta + azimuth, 0.1, path=touching))[1]
    away = pitch * body.rho / math.hypot(body.rho, slope)
    alone = Band(azimuth, slope * theta, slope)
    off, more = [], []
    for band in (alone, alone._replace(below=away, above=away)):
        a, b, area = band_centroid(view, body, band)
        off.append(abs(pixel_of_plane(view, a, b)[1] - truth["centroid"][1]))
        more.append(area * view.fx * view.fy / truth["area"] - 1.0)
    # Rays are taken for parallel over two turns, and the renderer's sections are chords of 3 px.
    assert off[1] < min(0.12, 0.5 * off[0])
    assert 0.0 < more[1] < 0.7 * more[0]


def test_only_a_gap_that_the_picture_does_not_show_cuts_a_band_off(smooth_film):
    film = smooth_film(4)
    view, body = view_and_body(film)
    setup = film.tracker().config.setup(view)
    for pixels, cut in ((0.0, True), (1.0, True), (2.0, False)):
        away = 2.0 * body.cable_radius + pixels / axis_scale(view)
        band = guarded(setup, Band(AZIMUTH, 0.0, 0.0, below=away, above=away), True, True)
        assert (band.low > -math.pi, band.high < math.pi) == (cut, cut), pixels
        assert band.low == -band.high


@pytest.fixture(scope="module")
def model():
    paint = np.array(PAINT) + 6.0 * np.random.default_rng(7).standard_normal((400, 3))
    return ColourModel.from_samples(np.clip(paint, 0, 255).astype(np.uint8))


@pytest.fixture(scope="module")
def seen(smooth_film, model):
    """A function that whitens a part of P0's picture and measures the band."""
    film = smooth_film(9)
    tracker = film.tracker()
    setup = tracker.config.setup(film.pinhole().view(tracker.config.pose))
    whole = film.frame_at(AZIMUTH)

    def measure(white, level=255, z=0.0, **cuts):
        band = Band(AZIMUTH, z, 0.0, **cuts)
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
        return measure_mark(
            picture, setup.camera, setup.body, gates, 0, band, pixels, 1.0, 1.0, WHOLE_AREA
        )

    return measure


def test_paint_under_white_light_is_unknown_and_grey_cable_is_not(model):
    glare = model.glare()
    for share, unknown in ((0.0, 0), (0.1, 0), (0.7, 1), (1.0, 1)):
        lit = np.minimum(np.array(PAINT) + 255.0 * share, 255.0).astype(np.uint8)
        assert glare[colour_index(lit)] == unknown, share
    for grey in (90, 150, 230):
        assert glare[colour_index(np.full(3, grey, np.uint8))] == 0, grey


@pytest.mark.slow
def test_a_band_without_glare_is_measured_as_a_whole(seen):
    assert seen(lambda along, across: np.zeros(along.shape, bool)).outcome == MEASURED


@pytest.mark.slow
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
    # The plain mean of what is left would be up to 40 mrad and 0.5 mm off. Where an edge is left on
    # one side only it is known to half a pixel, 3.5 mrad and 0.12 mm.
    assert found.azimuth == pytest.approx(whole.azimuth, abs=4.0e-3)
    assert found.z == pytest.approx(whole.z, abs=0.12e-3)


@pytest.mark.slow
def test_a_band_cut_off_on_one_side_shows_its_whole_way_and_on_both_sides_none(seen):
    def expected(z=0.0, **cuts):
        return seen(lambda along, across: np.zeros(along.shape, bool), z=z, **cuts)

    whole, away = expected(), 0.5e-3
    for one in (expected(-away, low=-0.6), expected(away, high=0.6)):
        # Two pixels beside where it lies. What the mask has wrong at the edge that is left counts
        # whole: half a pixel, 0.12 mm.
        assert one.z == pytest.approx(whole.z, abs=0.15e-3)
        assert one.z_factor == pytest.approx(math.sqrt(2.0))
    both = expected(away, low=-0.6, high=0.6)
    assert both.outcome == MEASURED
    assert both.z == away
    assert math.isinf(both.z_factor)


@pytest.mark.slow
def test_the_deviation_grows_where_an_end_is_hidden_and_not_where_none_is(seen):
    end = seen(lambda along, across: along > 0.2)
    flank = seen(lambda along, across: across > 0.2)
    assert end.azimuth_factor > 1.3
    assert flank.z_factor > 1.3


@pytest.mark.slow
def test_a_band_of_which_no_end_is_known_is_hidden(seen):
    assert seen(lambda along, across: np.abs(along) > 0.5).outcome == HIDDEN


@pytest.mark.slow
def test_something_grey_before_a_band_hides_it_still(seen):
    assert seen(lambda along, across: along > 0.2, 150).outcome == HIDDEN


def paint(colour, count=400, deviation=6.0):
    pixels = np.array(colour) + deviation * RNG.standard_normal((count, 3))
    return np.clip(pixels, 0, 255).astype(np.uint8)


def share(model, pixels):
    return model.mask(pixels[None]).mean()


def test_its_own_colour_is_accepted_and_others_are_not():
    model = ColourModel.from_samples(paint(YELLOW))
    assert share(model, paint(YELLOW)) > 0.99
    for other in ((225, 60, 30), (40, 200, 40), (30, 30, 220), (128, 128, 128), (20, 20, 20)):
        assert share(model, paint(other)) < 0.01


def test_light_may_change():
    model = ColourModel.from_samples(paint(YELLOW))
    for gain in (0.5, 0.7, 1.4, 2.0):
        lit = np.clip(paint(YELLOW).astype(float) * gain, 0, 255).astype(np.uint8)
        assert share(model, lit) > 0.98, gain


def test_a_background_of_similar_hue_is_distinguished():
    samples, background = paint(YELLOW), paint(BRASS, 20000)
    plain = ColourModel.from_samples(samples)
    apart = ColourModel.from_samples(samples, background)
    assert share(apart, paint(BRASS)) < 0.02
    assert share(apart, paint(YELLOW)) > 0.95
    assert apart.separation > 0.98
    assert np.isnan(plain.separation)


def test_a_marker_of_the_backgrounds_colour_is_refused():
    with pytest.raises(ColourRefusedError, match="distinguished"):
        ColourModel.from_samples(paint(BRASS, 100), paint(BRASS, 20000))


NO_COLOURS = [
    (np.empty((0, 3), np.uint8), "at least"),
    (np.full((300, 3), (0, 255, 255), np.uint8), "uniform"),
    (np.full((300, 3), 128, np.uint8), "uniform"),
    (paint((128, 128, 128)), "grey"),
    (RNG.integers(0, 255, (900, 3)).astype(np.uint8), "many hues"),
    (np.zeros((300, 4), np.uint8), "shape"),
    (np.zeros((300, 3)), "uint8"),
]


def test_samples_that_define_no_colour_are_refused():
    for samples, reason in NO_COLOURS:
        with pytest.raises(ColourRefusedError, match=reason):
            ColourModel.from_samples(samples)


def test_no_sample_however_clean_makes_a_model_of_every_hue():
    for colour in ((0, 255, 255), (0, 0, 255), (255, 0, 255), (30, 190, 225)):
        samples = np.full((300, 3), colour, np.uint8)
        samples[0] = np.clip(np.array(colour) - 3, 0, 255)
        model = ColourModel.from_samples(samples)
        assert model.hue_spread < 45.0, colour
        assert model.table.mean() < 0.25, colour


def test_an_odd_background_changes_nothing():
    backgrounds = {
        "nothing": np.empty((0, 3), np.uint8),
        "same": np.full((5000, 3), 90, np.uint8),
        "grey": paint((90, 90, 90), 5000),
    }
    for kind, background in backgrounds.items():
        model = ColourModel.from_samples(paint(YELLOW), background)
        assert share(model, paint(YELLOW)) > 0.98, kind


@pytest.mark.slow
def test_a_photographed_flower_is_found_from_a_small_sample():
    # The orange dahlia before green leaves.
    inside, outside = (slice(150, 250), slice(270, 370)), (slice(0, 90), slice(0, 120))
    photo = photograph("flower.jpg")
    patch = photo[190:201, 300:311].reshape(-1, 3)
    model = ColourModel.from_samples(patch, photo[outside].reshape(-1, 3))
    mask = model.mask(photo)
    assert mask[inside].mean() > 0.5
    assert mask[outside].mean() < 0.01
