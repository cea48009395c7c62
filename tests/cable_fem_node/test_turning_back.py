"""Machines that turn back: unwinding, guides that reverse, feeds to -z and none at all."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from axis_readings import axis_reading
from rods import CONFIG, DRIVE
from solver_bench import fed

from cable_fem_node.ros.message_handler import FemHandler
from cable_fem_node.ros.parameters import FemParameters
from cable_fem_node.winding.prediction import PlannedRun, predict
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.validity import crossing
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.cases import paper_case
from winding_core.machine.drive import DriveProfile, TurningDrive
from winding_core.machine.readings import AxisReading

WIDTH = CONFIG.case.cable_diameter * CONFIG.resolved.lateral
SPEED = DRIVE.angular_speed
Motion = Callable[[float], float]


def reading(angle: Motion, guide: Motion, t: float) -> AxisReading:
    """Return where both axes stand and how they move, their speeds by central differences."""
    step = 1.0e-5
    return axis_reading(
        angle(t),
        guide(t),
        speed=(angle(t + step) - angle(t - step)) / (2.0 * step),
        feed=(guide(t + step) - guide(t - step)) / (2.0 * step),
    )


def followed(
    config: WindingConfig, angle: Motion, guide: Motion, end: float, period: float
) -> RodWinding:
    model = RodWinding(config)
    for i in range(1, round(end / period) + 1):
        model.advance_to(period * i, reading(angle, guide, period * i))
    return model


def to_and_fro(t: float) -> float:
    """Wind, unwind by ten radians, and wind again."""
    back = 5.0 * (1.0 - math.cos(0.7 * (t - 3.0))) if 3.0 < t < 3.0 + math.tau / 0.7 else 0.0
    return SPEED * (t - 0.5 * (1.0 - math.exp(-2.0 * t))) - back


def wandering(t: float) -> float:
    """A guide that goes on and comes back."""
    return 0.004 * (1.0 - math.cos(0.6 * t)) + 0.0009 * t


@pytest.mark.slow
def test_unwinding_gives_the_cable_back() -> None:
    drive = TurningDrive(unwinds_from=13.0)
    model = PlannedRun(config=CONFIG, drive=drive, duration=drive.longest).model()
    count = round(50.0 * drive.longest)
    rows = []
    for i in range(1, count + 1):
        t = drive.longest * i / count
        model.advance_to(t, drive.reading_at(t))
        cable = model.cable()
        rows.append((model.cylinder_angle, cable["s"][-1], model.wound_stretch(), t))
    angle, length, stretch, time = np.array(rows).T
    out = time < 13.0
    at = np.linspace(3.0, angle.max() - 2.0, 40)

    def there_and_back(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        back = np.interp(at, angle[~out][::-1], values[~out][::-1])
        return np.interp(at, angle[out], values[out]), back

    assert angle.max() > 3.0 * math.tau
    # The bar of the specification is 0.1 %; measured 4e-6.
    one, other = there_and_back(length)
    np.testing.assert_allclose(other, one, rtol=1.0e-4)
    one, other = there_and_back(stretch)
    np.testing.assert_allclose(other, one, rtol=1.0e-4)
    # Everything is off the cylinder again but for what P0 holds, and the span is as it was.
    assert model.cylinder_angle == pytest.approx(0.0, abs=1.0e-9)
    assert model.cable()["strain"][-2] == pytest.approx(CONFIG.resolved.stretch - 1.0, rel=1.0e-3)
    assert model.cable()["s"][-1] < 0.21
    assert model.energy.balance_pct < 0.1


def test_feed_to_minus_z_is_the_mirror_image() -> None:
    ahead = predict(CONFIG, DriveProfile(), duration=6.0, rate=5.0)
    mirrored = predict(CONFIG, DriveProfile(feed_speed=-5.0e-3), duration=6.0, rate=5.0)
    # The same numbers but for rounding, which landing amplifies.
    np.testing.assert_allclose(mirrored.z, -ahead.z, atol=1.0e-7)
    np.testing.assert_allclose(mirrored.theta, ahead.theta, atol=1.0e-6)


def test_no_feed_winds_up_to_a_turn() -> None:
    run = predict(CONFIG, DriveProfile(feed_speed=0.0), duration=3.9, rate=5.0)
    assert run.theta[-1] > 5.5
    # In one plane: nothing pulls it aside.
    assert np.abs(run.z).max() < 1.0e-9
    again = PlannedRun(config=CONFIG, drive=DriveProfile(feed_speed=0.0), duration=4.3)
    assert "the guide advances 0 mm per turn" in again.checks()[-1].sentence
    with pytest.raises(ValueError, match="turns of the solid pass through each other"):
        replace(again, element="solid")


def test_guide_that_turns_back_over_its_turns_is_said_and_lays_cable_on_them() -> None:
    drive = TurningDrive(guide_turns_at=0.02)
    assert not PlannedRun(config=CONFIG, drive=drive, duration=8.0).checks()[-1].warned
    over = PlannedRun(config=CONFIG, drive=drive, duration=12.0)
    assert "the guide turns back: after 2." in over.checks()[-1].sentence
    lies = over.wind(whole=False).lies_per_turn()
    assert (lies[1], lies[-1] == "apart") == ("apart", False)
    # What would lie on cable is unwound before it is laid.
    back = TurningDrive(guide_turns_at=0.02, unwinds_from=7.0)
    assert not PlannedRun(config=CONFIG, drive=back, duration=back.longest).checks()[-1].warned


def test_guide_that_turns_back_lays_no_closer_than_the_check_allows() -> None:
    run = predict(CONFIG, TurningDrive(guide_turns_at=0.02), duration=7.8, rate=5.0)
    theta = np.linspace(math.tau, run.theta[-1], 200)
    apart = run.z_at(theta) - run.z_at(theta - math.tau)
    # The law of the check belongs to a limp cable; this one lands up to 0.4 mm ahead of it.
    assert apart.min() > WIDTH - 0.4e-3
    assert run.drive.positions(7.8)[1] < 0.02


def test_lay_over_a_turn_that_was_unwound_is_over_bare_cylinder() -> None:
    up = np.linspace(0.0, 3.0 * math.tau, 1000)
    down = np.linspace(3.0 * math.tau, math.tau, 700)
    guide = 2.0 * WIDTH / math.tau
    lag = 2.0
    angle = np.concatenate([up, down, up[350:]])
    retraced = guide * angle
    assert math.isinf(crossing(angle, retraced, lag, WIDTH)[-1])
    # Wound again with a guide that has gone back further, over the turn that is left.
    crossed = retraced.copy()
    crossed[1700:] = retraced[1700:] - 1.5 * WIDTH
    crossed[1000:1700] = np.linspace(retraced[999], crossed[1700], 700)
    assert crossing(angle, crossed, lag, WIDTH)[-1] < WIDTH


def test_past_the_start_nothing_can_be_unwound() -> None:
    drive = TurningDrive(unwinds_from=5.0)
    with pytest.raises(ValueError, match=r"turn back to -0\.87 rad, past the start"):
        PlannedRun(config=CONFIG, drive=drive, duration=drive.longest + 0.5)


def test_any_motion_is_followed_alike_in_long_and_short_steps() -> None:
    coarse = followed(CONFIG, to_and_fro, wandering, 12.5, 0.02)
    fine = followed(CONFIG, to_and_fro, wandering, 12.5, 0.005)
    a, b = coarse.cable(), fine.cable()
    # As for a steady drive: the step differs by a few percent, and the calls' noise remains.
    assert np.abs(a["z"] - b["z"]).max() < 2.0e-5
    assert coarse.energy.balance_pct < 0.1


def test_limp_cable_lies_where_the_guide_led_it_when_it_landed_last() -> None:
    thin = replace(paper_case(1), cable_diameter=1.0e-3, weight=0.3)
    # A guide that has moved beside unwound cable kinks it; friction that holds the kink.
    config = WindingConfig(case=thin, segment_length=2.5e-3, friction=2.0)
    model = followed(config, to_and_fro, wandering, 14.0, 0.02)
    part, lag = 5.0e-3, config.free_length / config.resolved.wound_radius
    lay = [0.0]
    for t in np.arange(0.0, 14.0, 1.0e-3).tolist():
        last = int(to_and_fro(t) / part)
        del lay[last + 1 :]
        while len(lay) <= last:
            lay.append(lay[-1] + (wandering(t) - lay[-1]) * -math.expm1(-part / lag))
    _, theta, z = model.wound_path()
    landed = (theta > 1.0) & (theta < part * (len(lay) - 1))
    law = np.interp(theta[landed], part * np.arange(len(lay)), lay)
    # The bar of the specification for 2.5 mm segments, where bending does not shift the lay.
    assert np.abs(z[landed] - law).max() < 5.0e-5


@pytest.mark.parametrize("feed", [5.0e-3, 0.0, -5.0e-3])
def test_node_follows_joint_states_that_turn_back(feed: float) -> None:
    handler = FemHandler(FemParameters(case=4, duration=0.5, feed_speed=feed, follow_tension=False))
    list(handler.begin(0.0))
    rows = [
        (t, reading(to_and_fro, wandering, t), None) for t in (5.0e-3 * np.arange(1201)).tolist()
    ]
    _, markers = fed(handler, rows)[-1]
    model = followed(CONFIG, to_and_fro, wandering, 6.0, 5.0e-3)
    ours = model.markers()
    # Messages carry doubles; the handler's first reading comes at the time at which it begins.
    for name in ("theta", "z", "s"):
        np.testing.assert_allclose(markers[name], ours[name], atol=1.0e-9)
