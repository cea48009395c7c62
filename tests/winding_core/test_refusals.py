"""What cannot be is refused in one sentence with the value and the limit."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import pytest

from winding_core.cable.cases import Case, Material, length_error_pct, paper_case
from winding_core.cable.condition import Condition
from winding_core.cable.prony import PronySeries
from winding_core.helix import (
    FleetAngleLaw,
    curve_length,
    free_length_of,
    lead_angle,
    pitch,
    turn_length,
)
from winding_core.machine.axes import MachineAxes
from winding_core.machine.drive import DriveProfile, TurningDrive
from winding_core.markers import MarkerLook, wound_markers
from winding_core.parameters import build

NOT_FINITE = (math.nan, math.inf)
CASE = {"cylinder_diameter": 0.045, "cable_diameter": 0.003, "weight": 2.5, "marker_spacing": 0.15}
SPAN = {"advance_per_radian": 0.003, "free_length": 0.198, "radius": 0.017}


def configured(**values: object) -> object:
    return build(Condition, values, owner="node /winding/rig").resolved()


def typed(**values: object) -> object:
    return Condition.from_typed(values, spelling=lambda key: f"--{key.replace('_', '-')}")


def hues(colours: str) -> object:
    return MarkerLook(marker_colours=colours).hues


Refusal = tuple[Callable[[], Any], str]


def by_name(make: Callable[..., Any], names: tuple[str, ...], values: Any, sentence: str) -> Any:
    """Return one refusal for each name and value."""
    return [
        (partial(make, **{name: value}), f"^{name} {sentence}")
        for name in names
        for value in values
    ]


def for_each(make: Callable[..., Any], values: tuple[Any, ...], sentence: str) -> list[Refusal]:
    return [(partial(make, value), sentence) for value in values]


REFUSALS: list[Refusal] = [
    *for_each(paper_case, (0, 13, -1), "case must be one of 1 to 12, got "),
    *by_name(lambda **given: Case(**{**CASE, **given}), tuple(CASE), (0.0, -0.002, *NOT_FINITE),
             "must be positive and finite"),
    (lambda: Case(**CASE, marker_count=0), "marker_count must be at least 1, got 0"),
    *by_name(Material, ("young", "density"), (0.0, -1.0, math.nan), "must be positive"),
    *by_name(Material, ("axial_factor", "bending_factor"), (0.0, -1.0, *NOT_FINITE),
             "must be positive and finite"),
    *by_name(Material, ("poisson",), (0.5, -0.1, math.nan), "must lie in"),
    *for_each(partial(length_error_pct, 0.1), (0.0, -0.1, math.nan),
              "predicted length must be positive"),
    *by_name(DriveProfile, ("angular_speed", "feed_speed", "ramp_time"),
             (*NOT_FINITE, -math.inf), "must"),
    *by_name(DriveProfile, ("angular_speed", "ramp_time"), (-1.0,), "must"),
    (lambda: DriveProfile(angular_speed=0.0), r"angular_speed must be positive, got 0\.0 rad/s"),
    (lambda: DriveProfile().time_at_angle(-0.1), "angle must not be negative"),
    (lambda: TurningDrive(guide_turns_at=-0.01), "it never gets there"),
    (lambda: TurningDrive(guide_turns_at=0.01, feed_speed=0.0), "it never gets there"),
    (lambda: TurningDrive(guide_turns_at=0.002), "at 2.5 mm or further"),
    (lambda: TurningDrive(unwinds_from=0.5), "from the end of the ramp at 1 s on, got 0.5 s"),
    (lambda: TurningDrive(unwinds_from=5.0).time_at_angle(9.0),
     r"turns back at 8\.7 rad, before 9 rad"),
    *by_name(lambda **given: FleetAngleLaw(**{**SPAN, **given}), ("free_length", "radius"),
             (0.0, -0.2, *NOT_FINITE), "must be positive"),
    *[(partial(free_length_of, distance, 0.017), "guide_distance must exceed")
      for distance in (0.017, 0.01, -1.0, math.nan)],
    *[(partial(length, radius=radius), "radius must be positive and finite")
      for radius in (0.0, -0.01, *NOT_FINITE)
      for length in (
          lambda radius: lead_angle(0.01, radius), lambda radius: pitch(0.1, radius),
          lambda radius: turn_length(radius, 0.01), lambda radius: curve_length(radius, 1.0, 0.0),
      )],
    (lambda: wound_markers(ids=[0], theta=[0.0], z=[0.0], radius=-0.017, cylinder_angle=1.0),
     "radius must be positive"),
    *for_each(hues, ("pink", "red,,blue", "-1", "360", "nan"), "marker_colours must list red"),
    *for_each(hues, ("40,50", "350,5"), "20 deg apart"),
    *for_each(PronySeries.parse, ("0.2", "0.2:x", "0.2:1+", "0.2:1:2"),
              "needs terms share:seconds"),
    (lambda: PronySeries.parse("-0.1:3"), "shares above 0, got -0.1"),
    (lambda: PronySeries.parse("nan:3"), "shares above 0, got nan"),
    (lambda: PronySeries.parse("0.1:0"), "times of 0.001 to 3e.09 s, got 0 s"),
    (lambda: PronySeries.parse("0.1:inf"), "got inf s"),
    (lambda: PronySeries.parse("0.6:1+0.4:2"), "add up to at most 0.95, got 1"),
    (lambda: PronySeries.parse("+".join(["0.01:1"] * 9)), "at most 8 terms, got 9"),
    (lambda: MachineAxes(cylinder_joint="spindle", carriage_joint="spindle"),
     "must be two joints, got spindle"),
    (lambda: configured(cylinder_diamter=0.03),
     r"^node /winding/rig has no parameter cylinder_diamter; did you mean cylinder_diameter\?$"),
    (lambda: configured(case=13), "^case must be one of 1 to 12, got 13"),
    (lambda: configured(case=-1), "^parameter case must be positive, got -1"),
    (lambda: configured(case="four"), "^parameter case must be a int, got 'four'"),
    (lambda: configured(case=True), "^parameter case must be a int, got True"),
    (lambda: configured(duration=math.nan), "^parameter duration must be finite, got nan"),
    (lambda: configured(duration=4000.0), "^parameter duration must be at most 3600, got 4000"),
    (lambda: configured(cable_diameter=-0.002),
     "^parameter cable_diameter must be positive, got -0.002"),
    (lambda: configured(weight=2.0, nominal_stress=1.0e6),
     "^give the tension once: weight or nominal"),
    (lambda: configured(case=0, cylinder_diameter=0.03, cable_diameter=0.004, marker_spacing=0.1),
     "^give case, or a whole condition: missing weight or nominal_stress"),
    (typed, "to wind: --case 1 to 12, or --cylinder-diameter-mm, --cable-diameter-mm"),
    (lambda: typed(case=0), "--case must be one of 1 to 12, got 0"),
    (lambda: typed(case=4, young_mpa=-4.0), "--young-mpa must be positive, got -4"),
    (lambda: typed(case=4, poisson=0.5), "--poisson must be at most 0.4999, got 0.5"),
    (lambda: typed(case=4, law="soft"), "--law must be one of linear, hencky"),
    (lambda: typed(case=4, tension_n=1.0, tension_mpa=1.0), "give the tension once: --tension-n"),
    (lambda: typed(case=4, guide_distance_mm=15.0), "--guide-distance-mm must exceed"),
    (lambda: typed(case=4, guide_distance_mm=250.0, free_length_mm=150.0),
     "give --guide-distance-mm or --free-length-mm, not both"),
    (lambda: typed(cable_diameter_mm=3.0),
     "missing --cylinder-diameter-mm, --tension-n or --tension"),
    (lambda: typed(case=4, duration_s=math.nan), "--duration-s must be finite, got nan"),
    (lambda: typed(case=4, prony="soft"), "^--prony needs terms"),
]  # fmt: skip


@pytest.mark.parametrize(("make", "sentence"), REFUSALS)
def test_what_cannot_be_is_refused(make: Callable[[], Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        make()
