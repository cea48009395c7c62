"""The inputs of a run: thinned and bounded, and still the same run."""

import numpy as np
import pytest
from rods import CASE, DRIVE, follow

from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.run_ahead import AbandonedError, replay
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.planned_inputs import continued_inputs, planned_inputs
from winding_core.run_inputs import RunHistory

# Coarse, so that the tests are quick: both sides of a comparison wind the same rod.
CONFIG = WindingConfig(case=CASE, segment_length=0.009)


def recorded(duration: float, **how: float) -> RunHistory:
    history = RunHistory(**how)  # type: ignore[arg-type]
    for sample in range(round(duration * 1000) + 1):
        history.record(sample * 1e-3, DRIVE.reading_at(sample * 1e-3), CASE.weight)
    return history


def test_replay_lays_the_cable_where_every_sample_laid_it() -> None:
    live = follow(RodWinding(CONFIG), 3.0, 1e-3, CASE.weight)
    again = RodWinding(CONFIG)
    replay(recorded(3.0).inputs, again)
    assert again.time == pytest.approx(3.0, abs=1e-9)
    s = np.linspace(0.0, 0.06, 7)
    paths = [
        [np.interp(s, model.wound_path()[0], column) for column in model.wound_path()[1:]]
        for model in (live, again)
    ]
    # A tenth of what the tracker resolves: 0.1 mrad and 0.01 mm.
    np.testing.assert_allclose(paths[0][0], paths[1][0], atol=1e-4)
    np.testing.assert_allclose(paths[0][1], paths[1][1], atol=1e-5)


def test_full_history_thins_itself_and_keeps_beginning_and_end() -> None:
    history = recorded(10.0, period=0.02, capacity=64)
    assert len(history) <= 64
    assert history.inputs["t"][0] == 0.0
    assert 10.0 - history.duration <= history.period
    # Every 20 ms would be 501 samples: a period three times doubled gives 63.
    assert history.period == pytest.approx(0.16)


def test_thinned_motion_is_that_of_the_machine() -> None:
    inputs = recorded(10.0, period=0.02, capacity=64).inputs
    angle, guide = DRIVE.positions(inputs["t"])
    np.testing.assert_allclose(inputs["cylinder_angle"], angle, atol=1e-12)
    np.testing.assert_allclose(inputs["carriage_position"], guide, atol=1e-12)


def test_kept_tension_is_the_mean_since_the_sample_before() -> None:
    rng = np.random.default_rng(0)
    history = RunHistory(period=0.02, capacity=64)
    for sample in range(10001):
        history.record(
            sample * 1e-3, DRIVE.reading_at(sample * 1e-3), 3.0 + 0.1 * rng.standard_normal()
        )
    tensions = history.inputs["tension"][1:]
    # 160 readings stand behind most: 0.1 / sqrt(160) = 0.008; single readings would spread by 0.1.
    assert tensions.std() < 0.02
    assert tensions.mean() == pytest.approx(3.0, abs=0.004)


def test_missing_tension_leaves_the_model_to_its_own_law() -> None:
    history = RunHistory()
    history.record(0.0, DRIVE.reading_at(0.0), None)
    history.record(1.0, DRIVE.reading_at(1.0), None)
    model = RodWinding(CONFIG)
    replay(history.inputs, model)
    assert model.span_tension == CASE.weight


def test_time_that_does_not_ascend_is_refused() -> None:
    history = recorded(0.1)
    with pytest.raises(ValueError, match=r"must ascend: after 0\.1 s came 0\.1 s"):
        history.record(0.1, DRIVE.reading_at(0.1), None)


@pytest.mark.parametrize(("name", "value"), [("period", 0.0), ("capacity", 3)])
def test_senseless_size_is_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name} must be"):
        RunHistory(**{name: value})  # type: ignore[arg-type]


def test_replay_ends_when_it_is_not_wanted() -> None:
    model = RodWinding(CONFIG)
    with pytest.raises(AbandonedError):
        replay(planned_inputs(DRIVE, 5.0), model, going=lambda: model.time < 1.0)
    assert model.time == pytest.approx(1.0, abs=0.021)


def test_continued_run_goes_on_at_top_speed() -> None:
    inputs = continued_inputs(planned_inputs(DRIVE, 5.0, tension=2.0), 12.0)
    angle, guide = DRIVE.positions(inputs["t"])
    np.testing.assert_allclose(inputs["cylinder_angle"], angle, atol=1e-9)
    np.testing.assert_allclose(inputs["carriage_position"], guide, atol=1e-12)
    assert inputs["cylinder_angle"][-1] >= 12.0
    assert (inputs["tension"] == 2.0).all()
