"""Control charts of runs: false announcements and drifts found, over many draws."""

import numpy as np
import pytest
from scipy.stats import norm

from winding_reports.runs.trend import ALLOWANCE, AVERAGE_RUN_LENGTH, FIRST, LIMIT, drift_chart

STATES = 400


def run_length() -> float:
    """Return the average run length of both sums, by Brook and Evans (1972), Biometrika 59."""
    width = LIMIT / (STATES - 0.5)
    places = width * np.arange(STATES)
    upper = places[np.newaxis] + 0.5 * width - places[:, np.newaxis] + ALLOWANCE
    reached = norm.cdf(upper)
    step = np.diff(reached, axis=1, prepend=0.0)
    one_sided = np.linalg.solve(np.eye(STATES) - step, np.ones(STATES))[0]
    # Kemp (1961): rates of both sides add up.
    return float(one_sided) / 2.0


def drawn(seed: int, stable: int, drifting: int, scatter: float) -> np.ndarray:
    """Return moduli [Pa] that grow by 2 % over 30 runs after some stable ones."""
    shares = scatter * np.random.default_rng(seed).standard_normal(stable + drifting)
    shares[stable:] += 0.02 * np.arange(1, drifting + 1) / 30.0
    return 3.1e6 * (1.0 + shares)


def test_stated_run_length_is_that_of_the_sums() -> None:
    assert run_length() == pytest.approx(AVERAGE_RUN_LENGTH, rel=0.03)


def test_two_hundred_stable_runs_have_no_more_than_two_false_announcements() -> None:
    counts = [len(drift_chart(drawn(seed, 200, 0, 0.003)).drifts) for seed in range(400)]
    # Poisson with 200 / 760: more than two once in 400. Four of 400 are as likely as 1 in 50.
    assert sum(count > 2 for count in counts) <= 4
    # Its mean over 400 draws has a standard deviation of 0.026.
    assert np.mean(counts) == pytest.approx(200 / AVERAGE_RUN_LENGTH, abs=0.1)


@pytest.mark.parametrize("stable", [0, 10, 20, 60])
@pytest.mark.parametrize("scatter", [0.0005, 0.001, 0.002, 0.003])
def test_two_percent_in_thirty_runs_are_announced_within_20(stable: int, scatter: float) -> None:
    found = 0
    for seed in range(200):
        drifts = drift_chart(drawn(seed, stable, 19, scatter)).drifts
        found += any(drift.up and drift.at >= stable for drift in drifts)
    # 0.91 at a scatter of 0.3 % without any stable run before, else 0.96 or more.
    assert found >= (170 if stable == 0 else 184)


def test_level_and_scatter_make_no_difference() -> None:
    values = np.random.default_rng(5).standard_normal(60)
    one, other = drift_chart(values), drift_chart(1.0e3 + 7.0 * values)
    np.testing.assert_allclose(one.upward, other.upward, atol=1e-8)
    assert np.isnan(one.upward[:FIRST]).all()


def test_a_step_is_announced_with_its_place_and_is_the_new_level() -> None:
    values = 0.1 * np.random.default_rng(2).standard_normal(80)
    values[40:] -= 0.5
    (drift,) = drift_chart(values).drifts
    assert not drift.up
    # Five standard deviations are announced with the second or third value.
    assert 37 <= drift.since <= 41 <= drift.at <= 44
    assert -0.5 < drift.now - drift.level < -0.2
    assert not drift_chart(values, falls=False).drifts


def test_equal_values_do_not_drift_and_another_one_does() -> None:
    assert not drift_chart(np.full(50, 3.1e6)).drifts
    assert [drift.at for drift in drift_chart([0.2] * 10 + [0.3]).drifts] == [10]


def test_what_is_not_finite_is_refused() -> None:
    with pytest.raises(ValueError, match="finite"):
        drift_chart([1.0, np.nan])
