"""How markers look: kinds, and colours as people name them."""

import pytest

from winding_core.markers import MarkerLook
from winding_core.parameters import ParameterError


def test_without_colours_all_markers_have_one() -> None:
    assert MarkerLook().hues == ()


def test_names_and_hues_may_be_mixed() -> None:
    assert MarkerLook(marker_colours="Red, 48,blue").hues == (0.0, 48.0, 230.0)


@pytest.mark.parametrize("colours", ["pink", "red,,blue", "-1", "360", "nan"])
def test_what_is_no_colour_is_refused(colours: str) -> None:
    with pytest.raises(ParameterError, match="marker_colours must list red"):
        _ = MarkerLook(marker_colours=colours).hues


@pytest.mark.parametrize("colours", ["40,50", "350,5"])
def test_colours_that_are_alike_are_refused(colours: str) -> None:
    with pytest.raises(ParameterError, match="20 deg apart"):
        _ = MarkerLook(marker_colours=colours).hues
