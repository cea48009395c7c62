"""Light, noise and smear that pictures show, and what is advised for them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from marker_film import DRIVE

from marker_tracker_node.detection.exposure_advice import (
    MOST_SMEAR,
    PictureLevels,
    exposure_advice,
    marker_speed,
    picture_levels,
)
from winding_rig_node.camera import CameraConfig, Light, SensorNoise

pytestmark = pytest.mark.slow
HUES, TOLERANCE = (50.0,), 22.0
FINE = PictureLevels(pictures=1, paint=210.0, saturated=0.0, noise=1.5)


def levels(paper_film, case=9, **camera):
    film = paper_film(case, camera=replace(CameraConfig(), **camera))
    pictures = [frame for _, frame, *_ in film.frames(2.0, stop=8.0)]
    return picture_levels(pictures, HUES, TOLERANCE)


def test_the_level_of_paint_goes_with_the_light_until_the_sensor_ends(paper_film):
    found = {gain: levels(paper_film, light=Light(gain=gain)) for gain in (0.25, 0.5, 1.0, 2.0)}
    for gain in (0.25, 0.5):
        # Noise and whole levels move the ninth tenth by two.
        assert found[gain].paint == pytest.approx(gain * found[1.0].paint, abs=2.0)
    assert [found[gain].saturated for gain in (0.25, 0.5, 1.0)] == [0.0, 0.0, 0.0]
    # Paint of 225 in the middle of twice the light would be 450.
    assert found[2.0].saturated > 0.5


@pytest.mark.parametrize("bayer", [False, True], ids=["three colours", "mosaic"])
@pytest.mark.parametrize("read", [1.5, 4.0, 12.0])
def test_noise_is_that_of_the_sensor(paper_film, read, bayer):
    noise = levels(paper_film, noise=SensorNoise(read=read, shot=0.0), bayer=bayer).noise
    # Steps of the median are 0.25 levels; whole levels add 0.29 in square, edges a fiftieth.
    assert noise == pytest.approx(read, rel=0.02, abs=0.25)


def test_a_marker_passes_as_fast_as_is_expected(paper_film):
    film = paper_film(9)
    angle = 4.0 * math.pi
    seen = [film.renderer.visible_bands(film.scene(angle + d, 0.0)) for d in (-0.02, 0.02)]
    before, after = (bands["centre"][0, 1] for bands in seen)
    case = film.case
    radius = case.cylinder_radius + case.cable_radius
    speed = marker_speed(film.pinhole(), film.camera.position[0], radius, DRIVE.angular_speed)
    # The centre line faces the camera there; the lens bends by less than 1 % in the middle.
    assert abs(after - before) / 0.04 * DRIVE.angular_speed == pytest.approx(speed, rel=0.01)
    with pytest.raises(ValueError, match=r"must stand more than 0\.1 m off, got 0\.1 m"):
        marker_speed(film.pinhole(), 0.1, 0.1, 1.0)


@pytest.mark.parametrize(
    ("given", "camera", "sentences"),
    [
        ({}, {}, ("exposure and gain fit: paint at level 210 of 255, 0% of it at its end",)),
        ({}, {"exposure": 1.0e-3, "speed": 300.0}, ("noise 1.5 grey levels, smear 0.3 px",)),
        ({}, {"speed": 500.0}, ("expose at most 2 ms",)),
        (
            {"paint": 240.0},
            {"exposure": 4.0e-3, "speed": 775.0},
            ("exposure 4 ms smears markers by 3.1 px at 775 px/s",
             "expose at most 1.3 ms; raise gain or light by 2.6"),
        ),
        (
            {"paint": 60.0, "noise": 4.0},
            {"exposure": 1.0e-3, "speed": 1000.0},
            ("paint is at level 60 of 255, at least 100 needed",
             "raise the light by 3.3; by gain noise would be 13 grey levels, at most 8 may be"),
        ),
        ({"paint": 50.0}, {}, ("level 50", "raise exposure, gain or light by 4")),
        ({"paint": 255.0, "saturated": 0.6}, {"exposure": 2.0e-3, "speed": 100.0},
         ("60% of the paint has a channel at its end, at most 20% may", "expose at most 1 ms")),
        ({"noise": 12.0}, {}, ("lower the gain by 1.5 and raise the light as much",)),
        ({"paint": math.nan}, {}, ("no pixels have the markers' hue",)),
    ],
)  # fmt: skip
def test_advice_has_the_number_that_follows(given, camera, sentences):
    advice = exposure_advice(replace(FINE, **given), **camera)
    assert len(advice.sentences) == len(sentences)
    for found, wanted in zip(advice.sentences, sentences, strict=True):
        assert wanted in found
    assert advice.fault == bool(given)


@pytest.mark.parametrize(("light", "exposure"), [(0.3, 4.0e-3), (2.0, 4.0e-3), (0.4, 1.0e-3)])
def test_pictures_taken_as_advised_need_no_further_change(paper_film, light, exposure):
    speed = 500.0
    found = levels(paper_film, light=Light(gain=light))
    advice = exposure_advice(found, exposure=exposure, speed=speed)
    assert advice.fault
    # Each factor acts on the light that the sensor turns into levels.
    changed = levels(paper_film, light=Light(gain=light * advice.exposure * advice.gain))
    exposure *= advice.exposure
    assert exposure * speed <= MOST_SMEAR * (1.0 + 1.0e-9)
    again = exposure_advice(changed, exposure=exposure, speed=speed)
    assert not again.fault, again.sentences


def test_grey_and_noisy_pictures_hold_no_paint():
    rng = np.random.default_rng(5)
    grey = rng.normal(60.0, 8.0, (10, 96, 640, 3)).clip(0, 255).astype(np.uint8)
    assert math.isnan(picture_levels(grey, HUES, TOLERANCE).paint)
