"""Cable on a drum rests on what lies below, climbs at the flange, and lands at its own radius."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from winding_core.cable.cases import paper_case
from winding_core.lay.drum_parameters import DrumWinding
from winding_core.lay.layers import WoundDrum
from winding_core.machine.drum import Drum
from winding_rig_node.camera.config import CameraConfig
from winding_rig_node.camera.renderer import Renderer
from winding_rig_node.camera.shown_lay import GrowingLay
from winding_rig_node.lay.driven_lay import DrivenLay, LaidTurns
from winding_rig_node.lay.lay_on import GRID_STEP, HiddenRig
from winding_rig_node.lay.truth import truth_record

CASE = paper_case(9)
D = CASE.cable_diameter
TURN = 2.0 * math.pi
DRUM = Drum(radius=CASE.cylinder_radius, width=8.5 * D, flange_height=10.0 * D)
# A cable without bending stiffness on a rig that takes nothing of the pull.
PLAIN = HiddenRig(free_length=0.2, load_share=1.0, drag=0.0)


def wound(winding: str, pitch: float, drum: Drum = DRUM) -> WoundDrum:
    return DrumWinding(winding=winding, pitch=pitch * D).wind(drum, D, layers=3)


def laid(
    path: WoundDrum, moved: NDArray[np.float64] | float = 0.0
) -> tuple[NDArray[np.float64], LaidTurns]:
    """Lay cable exactly where a path has it, or moved by so much [m]; return its angles too."""
    turns = LaidTurns(path.drum, CASE)
    theta = np.arange(1, int(path.theta[-1] / GRID_STEP)) * GRID_STEP
    for angle, z in zip(theta, path.program().z_at(theta) + moved, strict=True):
        turns.append(float(angle), float(z))
    return np.append(0.0, theta), turns


def within_layers(path: WoundDrum, theta: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the number of the layer at angles a turn and more from its ends; 0 elsewhere."""
    found = np.zeros(theta.shape, dtype=np.intp)
    for layer in path.layers:
        found[(theta > (layer.first_turn + 1) * TURN) & (theta < (layer.last_turn - 1) * TURN)] = (
            layer.number
        )
    return found


@pytest.mark.parametrize("pitch", [1.1, 1.2, 1.3])
def test_crossing_layers_lie_at_the_mean_radius_of_the_closed_form(pitch: float) -> None:
    path = wound("cross", pitch)
    theta, turns = laid(path)
    inside = within_layers(path, theta)
    for layer in path.layers:
        there = turns.radius[inside == layer.number]
        # Turns are sampled 314 times each, which is no whole number of crossings.
        assert there.mean() == pytest.approx(layer.radius, abs=0.01 * D)
        assert (turns.layer[inside == layer.number] == layer.number).all()


@pytest.mark.parametrize("pitch", [1.02, 1.3, 1.6])
def test_an_orthocyclic_turn_lies_in_the_valley_where_it_rests(pitch: float) -> None:
    # Half a pitch is left at the far flange: layers in the valleys are as wide.
    drum = replace(DRUM, width=(5.5 * pitch + 1.0) * D)
    path = wound("orthocyclic", pitch, drum)
    theta, turns = laid(path)
    inside = within_layers(path, theta)
    resting = (theta % TURN > 0.2) & (theta % TURN < 0.7 * TURN)
    for layer in path.layers:
        there = turns.radius[resting & (inside == layer.number)]
        assert there == pytest.approx(np.full(there.shape, layer.radius), rel=1e-9)


def test_cable_climbs_between_the_flange_and_its_neighbour() -> None:
    path = wound("cross", 1.0)
    theta, turns = laid(path)
    first = path.layers[0]
    arrived = (first.last_turn - 0.5) * TURN  # The dwell of half a turn is part of the layer.
    climb = (theta > arrived) & (theta < arrived + 0.45 * TURN)
    assert turns.radius[climb].min() == CASE.centreline_radius
    assert (np.diff(turns.radius[climb]) >= -1e-12).all()
    # After half a turn at the flange it lies in the valley beside it.
    end = np.searchsorted(theta, arrived + 0.5 * TURN) - 1
    valley = CASE.centreline_radius + 0.5 * math.sqrt(3.0) * D
    assert turns.radius[end] == pytest.approx(valley, abs=0.02 * D)


def test_no_cable_passes_a_flange_and_none_lies_in_another() -> None:
    rng = np.random.default_rng(1)
    path = wound("orthocyclic", 1.05)
    # Off by up to half a diameter, as slowly as a guide would be.
    count = int(path.theta[-1] / GRID_STEP) - 1
    moved = np.interp(np.arange(count), np.arange(0, count, 150), rng.uniform(
        -0.5 * D, 0.5 * D, math.ceil(count / 150)))  # fmt: skip
    theta, turns = laid(path, moved)
    low, high = DRUM.centre_lines(D)
    z, radius = turns._points[1, : theta.size], turns.radius
    assert low <= z.min()
    assert z.max() <= high
    per_turn = TURN / GRID_STEP
    for back in range(1, int(path.turns)):
        k = np.arange(math.ceil(back * per_turn), theta.size)
        older = theta[k] - back * TURN
        apart = np.hypot(
            z[k] - np.interp(older, theta, z), radius[k] - np.interp(older, theta, radius)
        )
        # Neighbours give way by 5 % of a diameter; straight lines between places 0.02 rad apart
        # miss an edge over which the cable comes down.
        assert np.quantile(apart, 0.01) > 0.94 * D


def test_a_turn_half_upon_its_neighbour_climbs_and_one_beside_it_slides_down() -> None:
    for beside, layer in ((0.45, 2), (0.55, 1)):
        turns = LaidTurns(DRUM, CASE)
        for angle in np.arange(GRID_STEP, 1.5 * TURN, GRID_STEP):
            turns.append(angle, 0.0 if angle < TURN else beside * D)
        assert turns.last.layer == layer
        assert turns.last.z == pytest.approx(beside * D if layer == 2 else D)


def driven(path: WoundDrum, hidden: HiddenRig = PLAIN) -> DrivenLay:
    """Wind a path with the guide where its lag on every layer needs it."""
    lay, program = DrivenLay(CASE, hidden, path.drum), path.program()
    distance = math.hypot(hidden.free_length, CASE.centreline_radius)
    for angle in np.arange(0.0, path.theta[-1], 0.01):
        radius = CASE.centreline_radius + float(program.raised_at(angle))
        lag = math.sqrt(distance**2 - radius**2) / radius
        guide = float(program.z_at(angle) + lag * program.slope_at(angle))
        lay.advance(float(angle), guide, CASE.weight)
    return lay


def test_cable_is_laid_by_the_length_of_its_own_circle() -> None:
    path = wound("cross", 1.2)
    lay = driven(path)
    truth = lay.truth(0.0)
    assert (truth.layer[within_layers(path, truth.theta) == 3] == 3).all()
    inside = within_layers(path, truth.theta[1:])
    way = np.hypot(truth.radius[:-1] * np.diff(truth.theta), np.diff(truth.z))
    stretch = way / np.diff(truth.length)
    settled = inside > 0
    # The pull is the same on every layer, and so is the stretch; z and length are kept together.
    assert stretch[settled] == pytest.approx(np.full(settled.sum(), lay.contact.stretch), rel=2e-3)


def test_the_span_ends_at_the_guide_from_every_radius() -> None:
    view = driven(wound("cross", 1.2)).view()
    rho = CASE.centreline_radius + view.landing_lift
    assert view.landing_lift > 1.5 * D
    distance = math.hypot(PLAIN.free_length, CASE.centreline_radius)
    assert math.hypot(view.free_length, rho) == pytest.approx(distance, rel=1e-12)


def test_unwound_cable_is_forgotten_with_its_layers() -> None:
    path = wound("orthocyclic", 1.05)
    lay, fresh = driven(path), DrivenLay(CASE, PLAIN, path.drum)
    lay.advance(0.5 * TURN, 0.0, CASE.weight)
    fresh.advance(0.5 * TURN, 0.0, CASE.weight)
    assert lay.truth(0.0).layer.max() == 1
    assert lay.view().free_length == pytest.approx(fresh.view().free_length)
    lay.restart()
    assert lay.truth(0.0).theta.size == 2


def test_the_truth_names_turn_and_layer_of_every_place() -> None:
    record = truth_record(driven(wound("cross", 1.2)).truth(0.0))["path"]
    assert len(record["theta"]) == len(record["radius"]) == len(record["layer"])
    assert record["turn"][0] == 1
    assert record["turn"][-1] == int(record["theta"][-1] / TURN) + 1
    assert {1, 2, 3} <= set(record["layer"])


def test_upper_layers_hide_lower_ones_in_the_picture() -> None:
    view = driven(wound("orthocyclic", 1.05)).view()
    seen = GrowingLay(view, lifted=True).at(view.eye, None)
    # A band on the first layer that upper ones cover, and one on the newest layer, both in front.
    angle = view.theta
    buried = angle - TURN * round((angle - 3.5 * TURN) / TURN)
    marks = np.array([0.0, buried, angle - TURN])
    scene = seen._replace(marker_theta=marks).scene(CASE, angle)
    bands = Renderer(CameraConfig()).visible_bands(scene)
    assert bands["area"][1] == 0.0
    assert bands["area"][2] > 0.0
    # Nearer cable is larger: its centre stands where its own radius puts it.
    lifted = float(seen.path.lifted(marks[2:])[0])
    assert lifted == pytest.approx(math.sqrt(3.0) * D, abs=0.15 * D)
