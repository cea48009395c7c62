"""A commissioning run: sensitivities, what it narrows, what stays unknown, what it leaves."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from cable_fem_node.identification import Readings, RigPosterior, TrackedRun, identify_rig
from cable_fem_node.identification.rig import Numbers, numbers_of, opened, unknowns_of
from cable_fem_node.identification.rig_lay import RigLay
from cable_fem_node.identification.rig_rod import rod_places
from cable_fem_node.winding.rig_prior import CELL
from cable_fem_node.winding.winding_config import SolverParameters, WindingConfig
from winding_core.cable.cases import paper_case
from winding_core.cable.condition import Condition
from winding_core.catalogue.cables import read_cable
from winding_core.parameters import ParameterError
from winding_core.run_spec import RunSpec
from winding_study.commissioning.design import SIGMA_THETA, SIGMA_Z, ranked
from winding_study.commissioning.motion import (
    MOST_BENT,
    MOST_STRESSED,
    MachineReach,
    Motion,
    candidates,
    clearing_advance,
    safe_pulls,
)
from winding_study.commissioning.result import cable_of, cell_text_of, remarks

pytestmark = pytest.mark.timeout(900)  # A cell takes a dozen rods, on a busy computer minutes

WHAT = Condition(case=4, law="neo_hookean", markers=24).resolved()
CONFIG: WindingConfig = SolverParameters().config_of(WHAT)
WEIGHT = WHAT.case.weight
UNKNOWNS = unknowns_of(CELL, CONFIG)
REACH = MachineReach(
    speeds=(1.74, 1.74),
    carriage_speed=0.08,
    travel=0.3,
    weight=WEIGHT,
    pulls=(0.3 * WEIGHT, 1.5 * WEIGHT),
    ramp_time=1.0,
)
MOTIONS = {motion.name: motion for motion in reversed(list(candidates(REACH)))}


def cell(**deviates: float) -> Numbers:
    names = [item.name for item in opened(UNKNOWNS)]
    q = np.zeros((1, len(names)))
    for name, value in deviates.items():
        q[0, names.index(name)] = value
    return numbers_of(UNKNOWNS, q)


def laid(motion: Motion) -> RigLay:
    return RigLay(CONFIG, motion.inputs(), commanded=motion.commanded)


def found(motion: Motion, numbers: Numbers, count: int = 15) -> RigPosterior:
    """Return what markers of the rod tell, without errors of the tracker."""
    theta, z = rod_places(laid(motion), numbers)
    readings = Readings(
        ids=np.arange(1, count + 1),
        theta=theta[:count],
        z=z[:count],
        sigma_theta=np.full(count, SIGMA_THETA),
        sigma_z=np.full(count, SIGMA_Z),
    )
    run = TrackedRun(
        config=CONFIG, inputs=motion.inputs(), readings=readings, commanded=motion.commanded
    )
    return identify_rig([run], CELL, draws=1500)


HIDDEN = cell(young=0.3, friction=-0.4, free_length=0.5, law_share=0.2, start_share=-0.3)


@pytest.fixture(scope="module")
def stepped() -> RigPosterior:
    return found(MOTIONS["in three steps down"], HIDDEN)


@pytest.fixture(scope="module")
def even() -> RigPosterior:
    return found(MOTIONS["even"], HIDDEN)


@pytest.mark.parametrize("name", ["young", "friction", "free_length", "start_share"])
def test_the_closed_form_moves_with_a_number_as_the_rod_does(name: str) -> None:
    lay = laid(MOTIONS["high, then low"])
    closed = lay(cell(**{name: 0.3}))[0][0] - lay(cell())[0][0]
    rod = rod_places(lay, cell(**{name: 0.3}))[0] - rod_places(lay, cell())[0]
    rod = rod[: closed.size]
    landed = np.isfinite(rod)
    # Elements of a fifth of a radian end a slip; start and free length differ by a tenth.
    assert closed[landed] == pytest.approx(rod[landed], rel=0.25, abs=5.0e-3)


def test_a_pull_slips_where_it_changes_faster_than_friction_holds() -> None:
    motion = MOTIONS["low, then high"]
    lay = laid(motion)
    steady = {"start_share": 8.0, "build_up_length": -8.0}
    angle, change = lay.slips(cell(**steady))[-1]
    assert angle == pytest.approx(motion.angles[3], abs=0.4)  # two places of the grid
    assert change > 0.0
    # ln 5 within 0.8 rad is what a friction of 2 just holds.
    assert not any(behind > 2.0 for behind, _ in lay.slips(cell(friction=8.0, **steady)))
    # Cable that slips is drawn on by the higher pull: less of it lies on the cylinder.
    smooth, rough = (lay(cell(friction=value))[0][0] for value in (-2.0, 2.0))
    assert smooth[12] > rough[12]


def test_a_slow_way_and_a_step_tell_more_than_steps_alone() -> None:
    names = ["in three steps down", "rising late, then low"]
    rows = {row.motion.name: row for row in ranked(CONFIG, [MOTIONS[x] for x in names], CELL)}
    steps, both = (rows[name] for name in names)
    assert both.gain > steps.gain
    assert both.share["law_share"] < 0.5 * steps.share["law_share"]


def test_many_cables_lie_as_each_of_them_does_alone() -> None:
    lay = laid(MOTIONS["falling"])
    shares = np.array([0.03, 0.33, 0.57])
    many = {name: np.repeat(value, 3) for name, value in cell(young=-1.0).items()}
    together = lay(many | {"law_share": shares})[0]
    for row, share in zip(together, shares, strict=True):
        alone = lay(cell(young=-1.0) | {"law_share": np.array([share])})[0][0]
        # A twentieth of what a tracker measures: between shares the stress is interpolated.
        assert row[:15] == pytest.approx(alone[:15], abs=0.05 * SIGMA_THETA)


def test_an_even_pull_and_a_brake_with_friction_lay_the_same() -> None:
    lay = laid(MOTIONS["even"])
    still, rubbing = (lay(cell(brake_friction=value))[0] for value in (-3.0, 3.0))
    np.testing.assert_array_equal(still, rubbing)


def test_modulus_load_share_and_drag_hide_behind_each_other() -> None:
    lay = laid(MOTIONS["falling"])
    numbers = cell()
    doubled = dict(numbers)
    for name in ("young", "load_share", "guide_drag"):
        doubled[name] = 1.1 * numbers[name]
    # Rounding alone.
    np.testing.assert_allclose(lay(doubled)[0], lay(numbers)[0], rtol=1.0e-12)


def test_a_commanded_pull_is_expected_to_tell_more_than_an_even_one() -> None:
    rows = ranked(CONFIG, MOTIONS.values(), CELL)
    order = [row.motion.name for row in rows]
    assert rows[0].motion.commands_pull
    assert rows[0].gain > rows[order.index("even")].gain
    assert all(0.0 < share <= 1.001 for row in rows for share in row.share.values())


@pytest.mark.slow
def test_the_posterior_holds_the_cell_that_was_wound(stepped: RigPosterior) -> None:
    assert not stepped.misfit
    for name in ("friction", "free_length", "start_share", "young"):
        item = stepped.beliefs[name]
        # Without noise the truth is nearer than three deviations.
        assert abs(float(HIDDEN[name][0]) - item.mean) < 3.0 * item.deviation, name
        assert item.deviation < item.prior_deviation


@pytest.mark.slow
def test_steps_of_pull_part_friction_and_drag(stepped: RigPosterior, even: RigPosterior) -> None:
    for name in ("friction", "drag_per_share", "young_per_share"):
        assert stepped.beliefs[name].half_width_90 < 0.5 * even.beliefs[name].half_width_90, name


@pytest.mark.slow
def test_what_an_even_pull_does_not_tell_is_named(even: RigPosterior) -> None:
    assert {"guide_drag", "load_share", "law_share"} <= set(even.unobservable)
    sentences = " ".join(remarks(even, ranked(CONFIG, MOTIONS.values(), CELL, even)))
    assert "guide drag" in sentences
    assert "the next run that tells most" in sentences


@pytest.mark.slow
def test_after_an_even_run_the_next_commands_the_pull(even: RigPosterior) -> None:
    assert ranked(CONFIG, MOTIONS.values(), CELL, even)[0].motion.commands_pull


@pytest.mark.slow
def test_the_files_hold_what_was_found(stepped: RigPosterior, tmp_path: Path) -> None:
    spec = RunSpec.from_cell(None, {"case": 4, "law": "neo_hookean", "feed_mm_s": 7.0})
    file = tmp_path / "hose.yaml"
    file.write_text(cable_of("hose", spec, stepped, "a run").text(), encoding="utf-8")
    cable = read_cable(file)
    # Files show six digits.
    young = 1.0e6 * cable.properties["young_mpa"]
    assert young == pytest.approx(stepped.best["young"][0], rel=1e-5)
    assert set(cable.uncertainty) == {"young_mpa", "mooney_ratio"}
    text = cell_text_of(spec, stepped, str(file), "a run")
    file.with_name("cell.yaml").write_text(text, encoding="utf-8")
    made = RunSpec.from_cell(file.with_name("cell.yaml"), {})
    assert made.condition.free_length == pytest.approx(stepped.best["free_length"][0], rel=1e-5)
    assert made.condition.young == pytest.approx(stepped.best["young"][0], rel=1e-5)
    assert made.condition.tension_offset == pytest.approx(stepped.best["guide_drag"][0], rel=1e-5)
    assert made.condition.feed_speed == Condition.feed_speed
    assert "90 % intervals" in text


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"travel": 0.01, "clear": 0.0176}, "the limits allow no motion of 2 turns"),
        ({"carriage_speed": 1.0e-3, "clear": 0.02}, "the limits allow no motion of 2 turns"),
        ({"longest": 61.0}, "at most 60 s, got 61 s"),
        ({"pulls": (2.0, 1.0)}, "pulls must ascend"),
        ({"weight": math.nan}, "the weight must be positive"),
        ({"speeds": (0.0, 1.0)}, "the cylinder speed must be positive"),
    ],
)
def test_limits_that_allow_no_motion_are_refused(wrong: dict[str, float], sentence: str) -> None:
    with pytest.raises(ParameterError, match=sentence):
        list(candidates(dataclasses.replace(REACH, **wrong)))


def test_no_motion_leaves_the_limits() -> None:
    for motion in candidates(REACH):
        assert motion.duration <= 60.0
        assert abs(motion.drive.positions(motion.duration)[1]) <= REACH.travel * (1.0 + 1e-9)
        assert min(motion.pulls) >= 0.3 * WEIGHT * (1.0 - 1e-12)
        assert max(motion.pulls) <= 1.5 * WEIGHT * (1.0 + 1e-12)


def test_a_thick_cable_is_not_pulled_so_little_that_bending_takes_the_tension() -> None:
    case = paper_case(5)
    found = safe_pulls(case, CELL, (0.1 * case.weight, 2.0 * case.weight))
    tension = 0.7 * found[0] + 0.15  # the middle of the prior
    bent = case.bending_stiffness / (2.0 * tension * case.centreline_radius**2)
    assert bent == pytest.approx(MOST_BENT, rel=1.0e-12)
    assert found[1] == 2.0 * case.weight


def test_a_thin_cable_is_not_pulled_to_where_its_law_ends() -> None:
    case = paper_case(8)
    found = safe_pulls(case, CELL, (0.3 * case.weight, 1.5 * case.weight))
    stress = (0.7 * found[1] + 0.15) / (case.material.young * case.axial_area)
    assert stress == pytest.approx(MOST_STRESSED, rel=1.0e-12)
    assert safe_pulls(case, CELL, (2.0 * case.weight, 3.0 * case.weight)) is None


def test_the_first_turn_clears_the_start_by_a_diameter() -> None:
    lag, diameter = 11.6, 4.0e-3
    pitch = clearing_advance(diameter, lag)
    turn = 2.0 * math.pi
    beside = pitch * (1.0 - (1.0 - math.exp(-turn / lag)) * lag / turn)
    assert beside == pytest.approx(diameter, rel=1.0e-12)
