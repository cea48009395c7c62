"""The guide after its targets: limits of the guide, of the joints, of patience; refusals."""

import math
from pathlib import Path

import numpy as np
import pytest
from arms import HOME, mapping_text

from winding_arm_driver.guide import Guided
from winding_arm_driver.leading import Led
from winding_core.arm.arm_file import MappingError, parse_mapping
from winding_core.machine.commands import CARRIAGE, CYLINDER, AxisTarget, JointTargets

PERIOD = 0.008


class Bench:
    """An arm that is at once where it is commanded to be."""

    def __init__(self, folder: Path, joint_speed: float = 3.14, **commands: object) -> None:
        text = mapping_text(folder, joint_speed, **commands)
        self.guided = Guided(parse_mapping(text, folder))
        self.joints, self.now = HOME.copy(), 0.0
        self._report()

    def _report(self) -> None:
        by_name = dict(zip(self.guided.joint_names, self.joints.tolist(), strict=True))
        stamp = round(1e9 * self.now)
        self.guided.add_joints(stamp, by_name, self.now)
        self.guided.add_cylinder(stamp, 0.0, self.now)
        ((_, self.reading),) = self.guided.readings(self.now)

    def aim(self, position: float, speed: float | None = None) -> None:
        target = AxisTarget(position=position, speed=speed)
        targets = JointTargets(t=self.now, axes={CARRIAGE: target})
        self.guided.aim(targets, self.now, turning=True)

    def step(self) -> Led:
        led = self.guided.advance(self.now, PERIOD, turning=True)
        self.now += PERIOD
        assert led.joints is not None
        self.joints = led.joints
        self._report()
        return led


def test_eye_is_where_the_mapping_puts_it(tmp_path: Path) -> None:
    reading = Bench(tmp_path, type="trajectory").reading
    # Of the decimals in the mapping and the description [m].
    assert (reading.guide.x, reading.guide.y) == pytest.approx((0.02, -0.2), abs=1.0e-9)
    assert reading.carriage_position == pytest.approx(0.0, abs=1.0e-9)


def test_guide_follows_a_stream_along_the_axis_and_keeps_its_place_across(tmp_path: Path) -> None:
    bench = Bench(tmp_path, type="trajectory")
    off = []
    for k in range(500):
        wanted = 0.01 * (1.0 - math.cos(2.0 * k * PERIOD))
        bench.aim(wanted, 0.02 * math.sin(2.0 * k * PERIOD))
        bench.step()
        reading = bench.reading
        along = reading.carriage_position - wanted
        off.append((along, reading.guide.x - 0.02, reading.guide.y + 0.2))
    along, *across = np.abs(off[50:]).max(axis=0).tolist()
    # A step of its closing loop behind: 20 mm/s for 8 ms; across, what the solver leaves [m].
    assert along < 2.0e-4
    assert max(across) < 2.0e-6


def test_step_is_taken_within_speed_and_acceleration(tmp_path: Path) -> None:
    bench = Bench(tmp_path, type="trajectory", speed_m_s=0.05, acceleration_m_s2=0.2)
    places = []
    for _ in range(400):
        bench.aim(0.1)
        bench.step()
        places.append(bench.reading.carriage_position)
    speeds = np.diff(places) / PERIOD
    # What the solver of the joints leaves, over a period.
    assert speeds.max() < 0.05 + 1.0e-3
    assert np.abs(np.diff(speeds)).max() / PERIOD < 0.2 + 0.05
    assert places[-1] == pytest.approx(0.1, abs=1.0e-5)


def test_guide_is_slowed_where_a_joint_would_be_too_fast(tmp_path: Path) -> None:
    bench = Bench(tmp_path, joint_speed=0.1, type="trajectory", speed_m_s=1.0)
    fastest = 0.0
    for _ in range(100):
        bench.aim(0.1)
        before = bench.joints
        bench.step()
        fastest = max(fastest, float(np.abs(bench.joints - before).max()) / PERIOD)
    # The share of the limit that is taken, and a period's change of the arm's Jacobian.
    assert 0.05 < fastest < 0.1
    assert "the guide is slowed to" in bench.guided.lead.remark
    assert "as near a singularity" in bench.guided.lead.remark


def test_guide_stands_when_targets_stop(tmp_path: Path) -> None:
    bench = Bench(tmp_path, type="trajectory", timeout_s=0.1)
    bench.aim(0.2, 0.05)
    while bench.guided.lead.active:
        bench.step()
    assert bench.guided.lead.remark == "the guide stands: no target has come for 0.1 s"
    before = bench.reading.carriage_position
    assert not bench.guided.lead.active
    bench.aim(before)
    bench.step()
    assert bench.guided.lead.remark == ""


@pytest.mark.parametrize(
    ("target", "sentence"),
    [
        (AxisTarget(position=0.6), r"within -0.05 to 0.5 m, got 0.6 m"),
        (AxisTarget(speed=0.2), r"not be faster than 0.1 m/s, got 0.2 m/s"),
    ],
)
def test_target_beyond_limits_is_refused(tmp_path: Path, target: AxisTarget, sentence: str) -> None:
    guided = Bench(tmp_path, type="trajectory").guided
    with pytest.raises(ValueError, match=sentence):
        guided.aim(JointTargets(t=0.0, axes={CARRIAGE: target}), 0.0, turning=True)
    assert not guided.lead.active


def test_travel_ends_where_the_arm_reaches_no_further(tmp_path: Path) -> None:
    bench = Bench(tmp_path, type="trajectory", high_m=2.0)
    with pytest.raises(ValueError, match=r"stay within -0.05 to 0.\d+ m, as the arm .*, got 1.9 m"):
        bench.aim(1.9)
    bench.aim(0.1)
    assert bench.step().joints is not None


def test_targets_of_a_standing_machine_and_old_ones_change_nothing(tmp_path: Path) -> None:
    guided = Bench(tmp_path, type="trajectory").guided
    targets = JointTargets(t=10.0, axes={CARRIAGE: AxisTarget(position=0.01)})
    with pytest.raises(ValueError, match="while the cylinder turns; it stands"):
        guided.aim(targets, 10.0, turning=False)
    with pytest.raises(ValueError, match=r"stamp must be within 0.5 s of the clock, got 2 s"):
        guided.aim(targets, 12.0, turning=True)
    assert not guided.lead.active


def test_cylinder_turns_while_its_encoder_counts(tmp_path: Path) -> None:
    guided = Bench(tmp_path, type="trajectory").guided
    assert not guided.turning(0.0)
    guided.add_cylinder(100, 1.0, 0.1)
    assert guided.turning(0.3)
    guided.add_cylinder(200, 1.01, 0.35)
    assert not guided.turning(0.5)


def test_target_of_the_cylinder_is_refused(tmp_path: Path) -> None:
    targets = JointTargets(t=0.0, axes={CYLINDER: AxisTarget(speed=1.0)})
    with pytest.raises(ValueError, match="leads the guide alone"):
        Bench(tmp_path, type="trajectory").guided.aim(targets, 0.0, turning=True)


POSED = "guide: {source: pose}\n"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("guide: {source: joints}", "need the arm's urdf"),
        (f"{POSED}commands: {{type: positions}}", "need the arm's urdf"),
        ("guide: {source: pose, eye_m: [1.0]}", "eye_m must be a list of 3 numbers, got"),
        (f"{POSED}cylinder: {{scale: 0.0}}", "scale of cylinder must not be 0"),
        (f"{POSED}commands: {{low_m: 1.0, high_m: 0.5}}", "low_m must be less than high_m, got 1"),
        (f"{POSED}command: {{}}", "command; did you mean commands"),
        ("- 1", "must be a mapping"),
    ],
)
def test_mapping_that_cannot_be_used_is_refused_in_one_sentence(text: str, sentence: str) -> None:
    with pytest.raises(MappingError, match=sentence) as refused:
        parse_mapping(text, Path())
    assert "\n" not in str(refused.value)
