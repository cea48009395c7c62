"""The joint posterior of a rig: what markers determine, what they do not, and how well.

Truths here are laid by the estimator's own closed form, which takes milliseconds: these tests are
about the inference. One test winds rods and compares; more of them are in
benchmarks/test_rig_accuracy.py. What comes in is a tracked marker once it counts as landed and
measured.
"""

import dataclasses

import numpy as np
import pytest
from rods import CASE, cable_on, case_of, readings, tracked, wound

from cable_fem_node.identification import (
    KNOWN_TENSION,
    IdentificationError,
    RigPosterior,
    RigPrior,
    TrackedRun,
    identify_rig,
)
from cable_fem_node.identification.rig_lay import RigLay
from cable_fem_node.identification.steady import SteadyConfig, SteadyMarkers
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.cases import paper_case
from winding_core.machine.tension import RigTension
from winding_core.markers import MarkerFlag, Markers, wound_markers

# docs/vision.md, on the 30 mm cylinder.
SIGMA_THETA, SIGMA_Z = 3.0e-3, 0.12e-3
SIGMAS = {"sigma_theta": SIGMA_THETA, "sigma_z": SIGMA_Z}
STEADY = {
    "young": 2.2e6,
    "free_length": 0.205,
    "load_share": 0.62,
    "guide_drag": 0.2,
    "start_share": 1.0,
    "build_up_length": 0.2,
}
BUILDING = STEADY | {"start_share": 0.4}
WHOLE = {"load_share": 1.0, "guide_drag": 0.0}  # The stated tension reaches the cylinder whole


def laid(run: TrackedRun, rig: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return theta and z of all markers of a run on a rig, by the closed form."""
    theta, z = RigLay.of(run)({name: np.array([value]) for name, value in rig.items()})
    return theta[0], z[0]


def run_of(
    case: int,
    markers: int,
    rig: dict[str, float],
    *,
    seed: int | None = None,
    tension: float | None = None,
) -> TrackedRun:
    """Return the first markers of a rig; without a seed they are where they lie."""
    every = np.arange(1, 5)
    run = tracked(case_of(case), 20.0, theta=6.0 * every, z=0.01 * every, **SIGMAS)
    if tension is not None:
        run.inputs["tension"] = tension
    theta, z = laid(run, rig)
    rng = np.random.default_rng(seed)
    share = 0.0 if seed is None else 1.0
    theta = theta + share * SIGMA_THETA * rng.standard_normal(4)
    z = z + share * SIGMA_Z * rng.standard_normal(4)
    return dataclasses.replace(run, readings=readings(theta=theta, z=z, **SIGMAS).first(markers))


def lengths(case: int, rig: dict[str, float]) -> np.ndarray:
    found = run_of(case, 4, rig).readings
    return np.hypot(paper_case(case).centreline_radius * found.theta, found.z)


def shifted(run: TrackedRun, shift: float | list[float]) -> TrackedRun:
    """Return a run whose angles are off [rad]."""
    theta = run.readings.theta + shift
    return dataclasses.replace(run, readings=dataclasses.replace(run.readings, theta=theta))


@pytest.fixture(scope="module")
def steady() -> RigPosterior:
    return identify_rig([run_of(4, 4, STEADY)])


def test_markers_determine_stretch_and_free_length_not_what_stretched(steady: RigPosterior) -> None:
    posterior = steady
    assert {"load_share", "guide_drag"} <= set(posterior.unobservable)
    beliefs = posterior.beliefs
    assert beliefs["free_length"].observed
    assert beliefs["free_length"].low < 0.205 < beliefs["free_length"].high
    weight = CASE.weight
    effective = 2.2e6 * weight / (0.62 * weight + 0.2)
    assert beliefs["effective_young"].low < effective < beliefs["effective_young"].high
    # A thousandth of the angle is a hundredth of the strain of 0.1: the modulus hides, this not.
    assert beliefs["effective_young"].half_width_90 < 0.02 * effective
    assert beliefs["young"].half_width_90 > 0.1 * beliefs["young"].mean


def test_modulus_hides_behind_the_load_share(steady: RigPosterior) -> None:
    correlation = steady.correlation
    # Among stretches that are known, a stiffer cable needs more load.
    assert correlation[0, 2] > 0.7
    assert np.allclose(np.diag(correlation), 1.0)


def test_known_tension_makes_the_modulus_known() -> None:
    posterior = identify_rig([run_of(4, 4, STEADY | WHOLE)], KNOWN_TENSION)
    young = posterior.beliefs["young"]
    assert young.low < 2.2e6 < young.high
    assert young.half_width_90 < 0.01 * young.mean
    assert posterior.unobservable == ()


def test_two_tensions_separate_drag_from_share() -> None:
    light = run_of(4, 4, STEADY, tension=2.0)
    heavy = run_of(4, 4, STEADY, tension=6.0)
    alone, both = identify_rig([light]), identify_rig([light, heavy])
    assert not alone.beliefs["guide_drag"].observed
    # (6 a + d) / (2 a + d) is known to about a percent, and with it d / a.
    ratio = both.rigs["guide_drag"] / both.rigs["load_share"]
    mean = float(both.weights @ ratio)
    spread = float(np.sqrt(both.weights @ (ratio - mean) ** 2))
    before = alone.rigs["guide_drag"] / alone.rigs["load_share"]
    assert spread < 0.6 * float(np.std(before))
    assert abs(mean - 0.2 / 0.62) < 3.0 * spread


def test_a_tension_that_builds_up_is_seen(steady: RigPosterior) -> None:
    assert steady.steady > 0.8
    building = identify_rig([run_of(4, 4, BUILDING)])
    assert building.steady < 0.01
    start = building.beliefs["start_share"]
    assert start.observed
    assert start.low < 0.4 < start.high


@pytest.mark.parametrize("rig", [STEADY, BUILDING])
def test_markers_to_come_lie_where_they_are_expected(rig: dict[str, float]) -> None:
    posterior = identify_rig([run_of(4, 2, rig)])
    truth = lengths(4, rig)
    assert [marker.id for marker in posterior.ahead[0]] == [3, 4]
    for marker in posterior.ahead[0]:
        assert marker.low < truth[marker.id - 1] < marker.high
    # P4 lies further from what was measured than P3.
    third, fourth = posterior.ahead[0]
    assert fourth.half_width_90 > third.half_width_90


@pytest.mark.slow
def test_intervals_hold_what_they_promise() -> None:
    prior, rng = RigPrior(), np.random.default_rng(7)
    inside: dict[str, list[bool]] = {"young": [], "free_length": [], "s": []}
    for seed in range(30):
        steady = rng.random() < prior.steady
        rig = {
            "young": 2.6e6 * np.exp(np.log(prior.young_factor) * rng.standard_normal()),
            "free_length": 0.198 * rng.uniform(*prior.free_length),
            "load_share": rng.uniform(*prior.load_share),
            "guide_drag": rng.uniform(*prior.guide_drag),
            "start_share": 1.0 if steady else rng.uniform(*prior.start_share),
            "build_up_length": float(np.exp(rng.uniform(*np.log(prior.build_up_length)))),
        }
        posterior = identify_rig([run_of(4, 2, rig, seed=seed)])
        for name in ("young", "free_length"):
            belief = posterior.beliefs[name]
            inside[name].append(belief.low <= rig[name] <= belief.high)
        last = posterior.ahead[0][-1]
        inside["s"].append(last.low <= lengths(4, rig)[-1] <= last.high)
    # Of 30 at 90 %, fewer than 22 come with a probability of 0.3 %.
    assert all(sum(found) >= 22 for found in inside.values()), inside


def test_more_markers_never_lose_what_is_known() -> None:
    widths = [
        identify_rig([run_of(4, count, BUILDING)]).beliefs["free_length"].half_width_90
        for count in (1, 2, 4)
    ]
    assert widths[0] > widths[1] > widths[2]


def test_contradicting_markers_widen_the_widths() -> None:
    run = run_of(4, 3, STEADY)
    good, bad = identify_rig([run]), identify_rig([shifted(run, [0.0, 0.1, 0.0])])
    assert not good.misfit
    assert bad.misfit
    # 0.1 rad are 1.7 mm on this cylinder; the scatter is of that order.
    assert 0.2e-3 < bad.scatter < 3.0e-3
    assert bad.ahead[0][0].half_width_90 > 5.0 * good.ahead[0][0].half_width_90
    assert not bad.refusal()


def test_markers_of_no_rig_are_refused() -> None:
    off = shifted(run_of(4, 4, STEADY), [0.0, 3.0, 0.0, 0.0])
    assert "limit 5%" in identify_rig([off]).refusal()


def test_stated_fixing_is_no_misfit() -> None:
    # P0 was fixed 1.7 mm along the cable from where it should be: all angles are off by as much.
    posterior = identify_rig([shifted(run_of(4, 3, STEADY), 0.1)], RigPrior(fixing=2.0e-3))
    assert not posterior.misfit
    expected = lengths(4, STEADY)[-1] + 0.1 * CASE.centreline_radius
    assert posterior.ahead[0][0].low < expected < posterior.ahead[0][0].high


def test_the_same_markers_give_the_same_posterior() -> None:
    first, second = (identify_rig([run_of(4, 2, BUILDING)]) for _ in range(2))
    assert np.array_equal(first.covariance, second.covariance)


def small(law: str, friction: float) -> WindingConfig:
    """Return a cable of 1.5 mm on a cylinder of 16 mm."""
    case = cable_on(16.0e-3, 1.5e-3, 0.4, 2.0e6, marker_count=4, marker_spacing=0.05)
    return WindingConfig(case=case, law=law, friction=friction)


# Bent by 0.005 to 0.07 of the tension, thinned, on 16 to 60 mm, building up, slippery and not.
WOUND = {
    # Behind the paper's span its first turn would touch the end of the cable.
    "bent": case_of(6, free_length=0.1),
    "wide": case_of(12, friction=0.5),
    "soft": case_of(2),
    "thinned": small("neo_hookean", 0.06),
    "hencky": small("hencky", 0.4),
    "building": case_of(4, tension_law=RigTension(start_share=0.4, build_up_length=0.15)),
}


@pytest.mark.parametrize("config", WOUND.values(), ids=WOUND.keys())
def test_closed_form_lies_where_the_rod_lies(config: WindingConfig) -> None:
    theta, z = wound(config)
    young = config.case.material.young
    run = tracked(config, 20.0, theta=theta, z=z, **SIGMAS)
    rig = STEADY | WHOLE | {"free_length": config.free_length}
    found, found_z = (row[: theta.size] for row in laid(run, rig | {"young": young}))
    stiffer, _ = laid(run, rig | {"young": 1.01 * young})
    # 0.2 % of E is the specification's.
    sensitivity = np.log(stiffer[: theta.size] / found) / np.log(1.01)
    assert np.abs(np.log(theta / found) / sensitivity).max() < 2.0e-3
    # Half the deviation of the tracker on the large cylinder.
    assert found_z == pytest.approx(z, abs=0.025e-3)
    # A data sheet that is off by a third does not matter.
    material = dataclasses.replace(config.case.material, young=young / 1.3)
    off = dataclasses.replace(config, case=dataclasses.replace(config.case, material=material))
    estimate = identify_rig([dataclasses.replace(run, config=off)], KNOWN_TENSION)
    assert estimate.beliefs["young"].mean == pytest.approx(young, rel=2.0e-3)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"scatter": -1.0}, "scatter must not be negative, got -1.0"),
        ({"load_share": (0.9, 0.5)}, "load_share must ascend"),
        ({"free_length": (0.0, 1.0)}, "free_length must be positive"),
        ({"guide_drag": (-1.0, 1.0)}, "guide_drag must not be negative"),
        ({"young_factor": 1.0}, "young_factor must exceed 1"),
        ({"steady": 1.5}, r"steady must lie in \[0, 1\]"),
        ({"fixing": float("nan")}, "fixing must be finite"),
    ],
)
def test_impossible_priors_are_refused(wrong: dict[str, object], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        RigPrior(**wrong)  # type: ignore[arg-type]


def test_runs_of_two_cables_are_refused() -> None:
    with pytest.raises(IdentificationError, match="one cable"):
        identify_rig([run_of(4, 2, STEADY), run_of(1, 2, STEADY)])
    with pytest.raises(IdentificationError, match="at least one run"):
        identify_rig([])


def frame(theta: float = 6.5, *, flags: int = 0, sigma: float = 2e-3, marker: int = 1) -> Markers:
    return wound_markers(
        ids=[0, marker],
        theta=[0.0, theta],
        z=[0.0, 0.004],
        radius=0.017,
        cylinder_angle=7.0,
        sigma_theta=[0.0, sigma],
        sigma_z=[0.0, 1e-4],
        flags=[0, flags],
    )


def seen(*frames: Markers) -> SteadyMarkers:
    markers = SteadyMarkers(SteadyConfig(frames=20))
    for each in frames:
        markers.add(each)
    return markers


def test_marker_counts_once_enough_frames_have_measured_it() -> None:
    assert seen(*[frame()] * 19).steady() == ()
    assert seen(*[frame()] * 19).readings() is None
    assert seen(*[frame()] * 20).steady() == (1,)


def test_reading_is_the_mean_with_the_deviation_of_one_frame() -> None:
    rng = np.random.default_rng(0)
    draws = 6.5 + 2e-3 * rng.standard_normal(400)
    readings = seen(*[frame(float(theta)) for theta in draws]).readings()
    assert readings.theta[0] == pytest.approx(draws.mean(), abs=1e-12)
    # The frames' 2 mrad and the camera's 1 mrad, which no number of frames averages away.
    assert readings.sigma_theta[0] == pytest.approx(np.hypot(2e-3, 1e-3))


@pytest.mark.parametrize(
    "flag", [MarkerFlag.OCCLUDED, MarkerFlag.CLIPPED, MarkerFlag.NOT_WOUND, MarkerFlag.PREDICTED]
)
def test_frames_that_did_not_measure_do_not_count(flag: MarkerFlag) -> None:
    assert seen(*[frame(flags=int(flag))] * 50).steady() == ()


def test_touching_turns_are_measured_all_the_same() -> None:
    assert seen(*[frame(flags=int(MarkerFlag.TOUCHING))] * 20).steady() == (1,)


def test_marker_that_slips_is_left_out_for_good() -> None:
    slipped = frame(flags=int(MarkerFlag.SLIPPED))
    assert seen(*[frame()] * 20, slipped, *[frame()] * 20).steady() == ()


def test_marker_that_wanders_is_not_steady() -> None:
    assert seen(*[frame(6.5 + 2e-3 * i) for i in range(40)]).steady() == ()


def test_nan_is_not_a_measurement() -> None:
    assert seen(*[frame(float("nan"))] * 50).steady() == ()
