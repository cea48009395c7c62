"""Programs from files and options: every kind is read, and what is read is what was written."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lay_control_node.programs import (
    crossings,
    even_helix,
    read_program,
    with_markers_every_turn,
)
from lay_control_node.programs.points import parse_csv
from winding_core.lay_program import LayProgram

TURN = 2.0 * math.pi
RADIUS = 0.0215


def written(folder: Path, name: str, text: str) -> LayProgram:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return read_program(path, radius=RADIUS)


@pytest.mark.parametrize(
    ("column", "scale"), [("turns", 1.0), ("theta_rad", TURN), ("theta_deg", 360.0)]
)
def test_angles_are_read_in_every_unit(tmp_path: Path, column: str, scale: float) -> None:
    rows = "\n".join(f"{scale * n!r},{18.0 * n!r}" for n in range(4))
    program = written(tmp_path, "a.csv", f"{column},z_mm\n{rows}\n")
    # Two roundings of a double.
    assert program.theta == pytest.approx(TURN * np.arange(4), rel=1e-15)
    assert program.z == pytest.approx(0.018 * np.arange(4), rel=1e-15)
    assert np.isnan(program.tension).all()


def test_length_of_cable_becomes_angle_on_the_helix(tmp_path: Path) -> None:
    turn = math.hypot(TURN * RADIUS, 0.018)
    program = written(tmp_path, "a.csv", f"length_m,z_m\n0,0\n{turn!r},0.018\n{3 * turn!r},0.054\n")
    # hypot and the root beside it round a few times.
    assert program.theta == pytest.approx([0.0, TURN, 3.0 * TURN], rel=1e-14)


def test_a_table_carries_pull_and_markers(tmp_path: Path) -> None:
    text = "# wanted\nturns,z_mm,tension_n,marker\n0,0,1.5,\n1,18,,P1\n\n2,36,2,2\n"
    program = written(tmp_path, "a.csv", text)
    assert program.markers == {1: TURN, 2: 2.0 * TURN}
    assert program.tension_at([0.1, TURN + 0.1]).tolist()[0] == 1.5
    assert math.isnan(program.tension_at(TURN + 0.1))


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.floats(1e-3, 20.0), st.floats(-50.0, 50.0)), min_size=1, max_size=20))
def test_a_table_of_a_program_is_that_program(steps: list[tuple[float, float]]) -> None:
    theta = np.concatenate([[0.0], np.cumsum([step for step, _ in steps])])
    z_mm = np.array([0.0, *(z for _, z in steps)])
    rows = "".join(f"{a!r},{b!r}\n" for a, b in zip(theta.tolist(), z_mm.tolist(), strict=True))
    program = parse_csv(f"theta_rad,z_mm\n{rows}", radius=RADIUS, name="made up")
    assert program.theta.tolist() == theta.tolist()
    assert program.z.tolist() == (1.0e-3 * z_mm).tolist()


def test_segments_follow_each_other(tmp_path: Path) -> None:
    text = """
name: two pitches and a rest
tension_n: 1.2
segments:
  - helix: {pitch_mm: 18, turns: 2}
  - dwell: {turns: 0.25}
    tension_n: 2
  - helix: {pitch_mm: 9, turns: 1}
markers: every_turn
"""
    program = written(tmp_path, "a.yaml", text)
    assert program.name == "two pitches and a rest"
    assert program.theta == pytest.approx(TURN * np.array([0.0, 2.0, 2.25, 3.25]))
    assert program.z == pytest.approx([0.0, 0.036, 0.036, 0.045])
    assert program.tension_at(TURN * np.array([1.0, 2.1, 3.0])).tolist() == [1.2, 2.0, 1.2]
    assert program.markers == pytest.approx({1: TURN, 2: 2 * TURN, 3: 3 * TURN})


def test_turns_between_flanges_turn_back_at_each(tmp_path: Path) -> None:
    text = "segments: [{reverse_at: {z_mm: [0, 45], pitch_mm: 18, turns: 6}}]"
    program = written(tmp_path, "a.yaml", text)
    assert program.theta == pytest.approx(TURN * np.array([0.0, 2.5, 5.0, 6.0]))
    assert program.z == pytest.approx([0.0, 0.045, 0.0, 0.018])


def test_a_swinging_pitch_is_the_integral_of_its_cosine(tmp_path: Path) -> None:
    text = "segments: [{cosine: {mean_pitch_mm: 18, amplitude_mm: 5, period_turns: 2, turns: 4}}]"
    program = written(tmp_path, "a.yaml", text)
    u = np.linspace(0.0, 4.0, 333)
    wave = 5.0e-3 * 2.0 / TURN * np.sin(TURN * u / 2.0)
    # Straight pieces leave the curve by A (2 pi / 180)^2 / 8.
    assert program.z_at(TURN * u) == pytest.approx(0.018 * u + wave, abs=1.6e-4 * 5.0e-3 * 2 / TURN)


def test_points_come_before_segments(tmp_path: Path) -> None:
    text = """
points: [{turns: 0, z_mm: 0}, {turns: 1, z_mm: 12, marker: 1}]
segments: [{helix: {pitch_mm: 18, turns: 1}}]
markers: {turns: {2: 1.9}}
"""
    program = written(tmp_path, "a.yml", text)
    assert program.z == pytest.approx([0.0, 0.012, 0.030])
    assert program.markers == pytest.approx({1: TURN, 2: 1.9 * TURN})


CYLINDER = """%
; Parameters {"mandrel": {"diameter": 43}}
N10 G21 G94 G90
G0 X50 A0 B0
G1 F3000 X{x1} A{a1} B-10
X{x2} A{a2} (back)
M30
X-1 A-1
"""


def test_gcode_of_a_cylinder_is_read(tmp_path: Path) -> None:
    text = CYLINDER.replace("{x1}", "104").replace("{a1}", "1080")
    text = text.replace("{x2}", "50").replace("{a2}", "2160")
    program = written(tmp_path, "a.gcode", text)
    assert program.theta == pytest.approx(TURN * np.array([0.0, 3.0, 6.0]))
    assert program.z == pytest.approx([0.0, 0.054, 0.0], abs=1e-15)
    said = " ".join(program.remarks)
    assert "head B (2 x)" in said
    assert "feed rates F (1 x)" in said
    assert "X 50 mm" in said


def test_gcode_may_be_relative_in_inches_and_descend(tmp_path: Path) -> None:
    text = "G20 G91\nG1 X1 A-360\nX1A-360.0\nG90 G92 A0 X0\nG1 X-1 A-180\n"
    program = written(tmp_path, "a.nc", text)
    assert program.theta == pytest.approx(TURN * np.array([0.0, 1.0, 2.0, 2.5]))
    assert program.z == pytest.approx(25.4e-3 * np.array([0.0, 1.0, 2.0, 1.0]))


def test_markers_on_every_turn_end_with_the_program_or_the_cable() -> None:
    helix = even_helix(0.018, 4.5)
    assert sorted(with_markers_every_turn(helix).markers) == [1, 2, 3, 4]
    assert sorted(with_markers_every_turn(helix, 2).markers) == [1, 2]


def test_turns_of_opposite_direction_cross_once_each_half_turn() -> None:
    program = LayProgram(theta=TURN * np.array([0.0, 2.0, 4.0]), z=np.array([0.0, 0.036, 0.0]))
    # Up and down at one pitch meet symmetrically about the reversal, at whole half turns.
    met = [round((item.theta + item.below) / TURN, 9) for item in crossings(program)]
    assert met == [4.0] * len(met)
    apart = [round((item.theta - item.below) / TURN, 9) for item in crossings(program)]
    assert apart == [1.0, 2.0, 3.0]
