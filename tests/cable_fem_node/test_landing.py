"""How cable lands: it keeps the tension that bending leaves it, and it does not bounce."""

from __future__ import annotations

import math

import pytest
from random_conditions import condition

from cable_fem_node.winding.prediction import PlannedRun
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.cases import Case, Material, paper_case
from winding_core.machine.drive import DriveProfile


def stiff_run(bending_share: float, segment: float) -> PlannedRun:
    """Return a run of a 4 mm cable on 60 mm whose bending takes a share of its tension."""
    young, radius = 2.5e6, 32.0e-3
    bending = young * math.pi * 4.0e-3**4 / 64.0
    case = Case(
        cylinder_diameter=60.0e-3,
        cable_diameter=4.0e-3,
        weight=0.5 * bending / (bending_share * radius**2),
        material=Material(young=young),
        marker_count=1,
        marker_spacing=0.3,
    )
    # Slow enough for the tensions of stiff cables, a few hundredths of a newton.
    drive = DriveProfile(angular_speed=0.6, feed_speed=0.5e-3)
    config = WindingConfig(case=case, law="linear", segment_length=segment)
    return PlannedRun(config=config, drive=drive, duration=8.0)


@pytest.mark.parametrize("bending_share", [0.05, 0.2])
def test_bending_takes_its_share_of_the_tension(bending_share):
    run = stiff_run(bending_share, 5.0e-3)
    result = run.wind(whole=False)
    wound = result.cable["tension"][2 : result.arc.size - 2].mean()
    share = 1.0 - wound / run.config.resolved.tension
    # Measured 0.048 and 0.196, from 0.050 and 0.200 in the limit of short elements. Elements that
    # are held where they land lose 0.035 and 0.165.
    assert share == pytest.approx(run.config.resolved.bending_share, rel=0.07)


@pytest.mark.parametrize("case", [1, 4])
def test_cable_does_not_bounce_where_it_lands(case):
    drive = DriveProfile()
    model = RodWinding(WindingConfig(case=paper_case(case), rests=False))
    for i in range(1, 401):
        model.advance_to(5.0e-3 * i, drive.reading_at(5.0e-3 * i))
    laid, landings = model.wound_path()[0].size, 0
    while landings < 2:
        t = model.time + model.step_limit
        model.advance_to(t, drive.reading_at(t))
        before, laid = laid, model.wound_path()[0].size
        assert laid in (before, before + 1)
        landings += laid - before


# A light cable that bounced until its energy balance was open by 1.5 %, and one that did not. The
# bar is the paper's conditions'; measured 0.003.
@pytest.mark.parametrize("seed", [1, 26])
def test_landing_neither_makes_nor_takes_energy(seed):
    config, drive = condition(seed)
    run = PlannedRun(config=config, drive=drive, duration=3.0)
    assert run.wind(whole=False).energy.balance_pct < 0.1


def test_strain_of_a_stiff_cable_does_not_hang_on_its_elements():
    # What bending takes is 5 % of the tension. Measured 8e-4, with elements that are held where
    # they land 6e-3.
    one, other = (stiff_run(0.05, length).wind(whole=False) for length in (5.0e-3, 2.5e-3))
    assert one.stretch - 1.0 == pytest.approx(other.stretch - 1.0, rel=2.0e-3)
