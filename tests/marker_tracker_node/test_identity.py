"""Which band is P0 follows from the places of all bands together, or is ambiguous."""

import math
from dataclasses import replace

import numpy as np
import pytest

from marker_tracker_node.tracking.identity import identified
from marker_tracker_node.tracking.p0_search import MovingBand
from marker_tracker_node.tracking.report import crossing, missing_markers
from marker_tracker_node.tracking.state import PATH_STEP, TrackerState
from winding_verification.tracker.scenes import World

# Begun behind P0, so that P1, which comes before it, is the first to be seen.
SEEDS = [7305, 7308, 7313, 7322]


def bands_of(world, begun, end, shift=0.0, along=0.0):
    """Bands of a run that was looked at between two angles of the cylinder [rad].

    The encoder reads further than that by a shift [rad], the camera stands beside [m].
    """
    found = []
    for theta, z in np.transpose(world.markers):
        passes = theta + math.tau * np.arange(-3.0, 8.0)
        passes = passes[(passes >= max(begun, theta)) & (passes <= end)]
        if passes.size:
            first, last = passes[[0, -1]] + shift
            offset = math.remainder(-theta - shift, math.tau)
            found.append(MovingBand(offset=offset, z=z + along, first=first, last=last))
    return found


def identity(world, end, shift=0.0, along=0.0):
    """Which band is P0 of a run joined at 1.4 rad, as of an angle of the cylinder [rad]."""
    path = world.config().law.z(PATH_STEP * np.arange(int(end / PATH_STEP)))
    bands = bands_of(world, 1.4, end, shift, along)

    def origin(band):
        off = math.remainder(band.offset, math.tau)
        return -off if abs(off) < 0.4 else -off + math.tau * round((shift + off) / math.tau)

    return bands, identified(
        bands, world.config(), lambda at: np.array([path, path]), origin, (1.4 + shift, 0.0), 0.41
    )


@pytest.mark.parametrize("offset", [-0.025, -0.02, 0.0, 0.02])
@pytest.mark.parametrize("seed", SEEDS)
def test_p0_is_known_wherever_the_guide_stood(seed, offset):
    world = replace(World.drawn(seed), landing=offset)
    bands, found = identity(world, 14.0)
    assert found.first is bands[0]
    np.testing.assert_array_equal(found.numbers, np.arange(len(bands)))
    np.testing.assert_allclose(found.theta, world.markers[0][found.numbers], atol=1.0e-9)


@pytest.mark.parametrize(("shift", "along"), [(1.7, 0.0), (-0.9, 2.0e-3), (0.0, -14.0e-3)])
def test_neither_encoder_nor_camera_change_who_is_p0(shift, along):
    bands, found = identity(World.drawn(SEEDS[0]), 14.0, shift, along)
    assert found.first is bands[0]


def test_what_two_bands_explain_alike_waits_for_more():
    # P1 comes 0.1 rad beside P0, as far as a camera that is set by tape may be off.
    world = replace(World.drawn(7330), landing=-0.02)
    assert identity(world, 14.0)[1] is None
    bands, found = identity(world, 26.0)
    assert found is None or found.first is bands[0]


def known(world, rise):
    """A setup, and a state with P1 known beside P0 and so many diameters above."""
    config, state = world.config(), TrackerState.fresh(world.marker_count)
    marks = state.marks
    marks.known[:2] = True
    marks.theta[1], marks.height[1] = math.tau - 0.1, rise * 2.0 * world.cable_radius
    return config.setup(world.pinhole().view(config.pose)), state


def test_neighbours_nearer_than_cable_beside_cable_lie_on_one_another():
    world = World.drawn(SEEDS[0])
    assert crossing(*known(world, 1.0)) == ""
    assert crossing(*known(world, 0.5)).startswith("P1 lies on P0")


def test_a_p0_that_comes_round_unseen_was_not_found():
    setup, state = known(World.drawn(SEEDS[0]), 1.0)
    for angle, missing in ((7.0, ()), (8.0, (0,))):  # a turn and 1.08 rad
        state.run_rows["cylinder"]["angle"] = angle
        assert missing_markers(setup, state, p0_late=False) == missing
    state.marks.weight[0] = 1.0
    assert missing_markers(setup, state, p0_late=False) == ()
