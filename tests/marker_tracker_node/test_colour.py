"""The colour model: what it accepts, what it refuses, on synthetic and on real pixels."""

import numpy as np
import pytest
from marker_film import photograph

from marker_tracker_node import ColourModel, ColourRefusedError
from marker_tracker_node.detection.colour import hsv

RNG = np.random.default_rng(7)


def paint(colour, count=400, deviation=6.0):
    pixels = np.array(colour) + deviation * RNG.standard_normal((count, 3))
    return np.clip(pixels, 0, 255).astype(np.uint8)


YELLOW = (30, 190, 225)
BRASS = (70, 150, 180)


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


def test_photographed_grey_sky_is_refused():
    photo = photograph("china.jpg")
    _, saturation, _ = hsv(photo[5:25, 300:340])
    assert np.median(saturation) < 0.25
    with pytest.raises(ColourRefusedError, match="grey"):
        ColourModel.from_samples(photo[5:25, 300:340].reshape(-1, 3))
