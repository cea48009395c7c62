"""Programs from files and options: every kind is read, and what cannot be wound is refused."""

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
    refuse_beyond,
    refuse_overlap,
    with_markers_every_turn,
)
from lay_control_node.programs.points import parse_csv
from lay_control_node.programs.reading import MOST_BYTES
from winding_core.lay.program import LayProgram, LayProgramError

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
    remarks = " ".join(program.remarks)
    assert "head B (2 x)" in remarks
    assert "feed rates F (1 x)" in remarks
    assert "X 50 mm" in remarks


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


DIAMETER = 3.0e-3

REFUSED = {
    "a.txt": [("x", "a lay program ends in")],
    "a.csv": [
        (" \n", "is empty"),
        ("turns,z_mm\n0,0\n1,18\n1,20\n", "line 4 of a.csv: wound angles must ascend"),
        ("turns,z_mm\n0,0\n1,nan\n", "line 3 of a.csv: z_mm must be finite, got nan"),
        ("turns,z_mm\n0,0\n1,1e999\n", "line 3 of a.csv: z_mm must be finite, got inf"),
        ("turns,z_mm\n0,0\n1,\n", "line 3 of a.csv: z_mm must be a number, got ''"),
        ("turns,z_mm\n0,0\n1\n", "line 3 of a.csv has 1 cells, the head line has 2"),
        ("turns,z_mm\n", "two points or more, got 0"),
        ("turns,z_mm\n0,0\n", "two points or more, got 1"),
        ("turns,z_mm\n1,0\n2,18\n", "line 2 of a.csv: a program begins at P0"),
        ("turns,theta_rad,z_mm\n0,0,0\n", "has turns|it has theta_rad, turns"),
        ("turns\n0\n", "needs one of z_m, z_mm, it has none"),
        ("turns,z_mm,tensoin_n\n0,0,1\n", "'tensoin_n'; did you mean tension_n"),
        ("turns;z_mm\n0;0\n", "parts its columns with ;"),
        ("turns,turns\n0,0\n", "names a column twice"),
        ("turns,z_mm,tension_n\n0,0,-1\n1,18,1\n", "tension must not be negative, got -1 N"),
        ("turns,z_mm,marker\n0,0,\n1,18,1\n2,36,1\n", "line 4 of a.csv: marker 1 is there twice"),
        ("turns,z_mm,marker\n0,0,\n1,18,0\n", "numbered from 1 on, got 0"),
        ("turns,z_mm,marker\n0,0,\n1,18,2\n2,36,1\n", "marker 2 must land after"),
        ("length_mm,z_mm\n0,0\n10,18\n", "10 mm of cable cannot cover 18 mm of z"),
        ("turns,z_mm\n0,0\n20000,18\n", "at most 10000 turns, got 20000"),
        ('turns,z_mm\n0,"0\n', "line 2 of a.csv"),
        ("turns,z_mm\n0,0\n1,\0\n", "line 3 of .*a.csv holds a zero byte"),
    ],
    "a.yaml": [
        ("{", "is no YAML"),
        ("[1]", "must hold a mapping"),
        ("name: x", "holds neither points nor segments"),
        ("segment: []", "holds 'segment'"),
        ("segments: []", "segments must be a list"),
        ("segments: [{spiral: {turns: 1}}]", "a segment is one of helix"),
        ("segments: [{helix: {pitch_mm: 18}}]", "segment 1: helix needs turns"),
        ("segments: [{helix: {pitch_mm: 18, turns: 1, x: 1}}]", "takes pitch_mm, turns, got 'x'"),
        ("segments: [{helix: {pitch_mm: 18, turns: -1}}]", "turns must lie above 0"),
        ("segments: [{helix: {pitch_mm: .nan, turns: 1}}]", "pitch_mm must be finite"),
        ("segments: [{helix: {pitch_mm: yes, turns: 1}}]", "pitch_mm must be a number"),
        ("segments: [{helix: {pitch_mm: 1, turns: 1}, dwell: {turns: 1}}]", "it holds 2 of them"),
        ("segments: [{reverse_at: {z_mm: [5, 20], pitch_mm: 18, turns: 3}}]",
         "hold the 0 mm where the cable lies, got 5 to 20 mm"),
        ("segments: [{reverse_at: {z_mm: [0, 0.001], pitch_mm: 1000, turns: 9999}}]",
         "at most 100000 points"),
        ("segments: [{cosine: {mean_pitch_mm: 9, amplitude_mm: 1, period_turns: 0, turns: 1}}]",
         "period_turns must be at least 0.01"),
        ("points: [{turns: 0, z_mm: 0}, 3]", "point 2 must be a mapping"),
        ("points: [{turns: 0, z_mm: 0}, {turns: 1, z_mm: [1]}]", "z_mm must be a number, got list"),
        ("segments: [{dwell: {turns: 1}}]\nmarkers: {1: 2}", "markers must be every_turn"),
        ("segments: [{dwell: {turns: 1}}]\nmarkers: {turns: {a: 2}}", "are whole numbers"),
        ("segments: [{dwell: {turns: 1}}]\nmarkers: {turns: {1: 2}}", "by the end"),
    ],
    "a.ngc": [
        ("G1 X1 A10\nG2 X1 A20\n", "line 2 of a.ngc has G2"),
        ("G1 X1 A10\nX2\n", "line 2 of a.ngc: the carriage moves while the mandrel stands"),
        ("G1 X1 A10\nA5\n", "line 2 of a.ngc: the mandrel turns back by 5 degrees"),
        ("X1 A10\n", "line 1 of a.ngc moves before any G0 or G1"),
        ("G1 Y10 X1\n", "line 1 of a.ngc has Y10"),
        ("G1 X1 A#3\n", "line 1 of a.ngc is no G-code from 'A#3'"),
        ("G1 X[1+2]\n", "is no G-code"),
        ("G1 X5\n", "never turns the mandrel"),
        ("G1 A1e999 X1\n", "moves beyond any number"),
        ("/G1 A10 X1\n", "may be left out"),
        ("G1 A10 A20 X1\n", "has A twice"),
    ],
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "text", "sentence"),
    [(name, text, sentence) for name, items in REFUSED.items() for text, sentence in items],
)
def test_unusable_programs_are_refused(tmp_path: Path, name: str, text: str, sentence: str) -> None:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    with pytest.raises(LayProgramError, match=sentence.replace("[", r"\[")) as caught:
        read_program(path, radius=RADIUS)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LayProgramError, match=r"cannot read .*missing.csv"):
        read_program(tmp_path / "missing.csv", radius=RADIUS)
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(LayProgramError, match="cannot read"):
        read_program(tmp_path / "folder.csv", radius=RADIUS)
    large = tmp_path / "large.csv"
    large.write_bytes(b"x" * (MOST_BYTES + 1))
    with pytest.raises(LayProgramError, match="larger than 10000000 bytes"):
        read_program(large, radius=RADIUS)
    coded = tmp_path / "coded.csv"
    coded.write_bytes(b"turns,z_mm\n0,0\n1,\xff\n")
    with pytest.raises(LayProgramError, match=r"line 3 of .* is no UTF-8"):
        read_program(coded, radius=RADIUS)


def test_neighbours_closer_than_the_cable_are_refused() -> None:
    refuse_overlap(even_helix(DIAMETER, 5.0), DIAMETER)
    with pytest.raises(LayProgramError, match=r"2\.9 mm beside .* diameter of 3 mm"):
        refuse_overlap(even_helix(-2.9e-3, 5.0), DIAMETER)


def test_a_rest_is_refused_where_it_lays_the_cable_on_itself() -> None:
    def resting(turns: float) -> LayProgram:
        theta = TURN * np.array([0.0, 2.0, 2.0 + turns, 4.0 + turns])
        return LayProgram(theta=theta, z=np.array([0.0, 0.036, 0.036, 0.072]))

    # Of a pitch of 18 mm what lies beside a rest of 0.8 turns is 3.6 mm away.
    refuse_overlap(resting(0.8), DIAMETER)
    with pytest.raises(LayProgramError, match=r"turns would overlap: at 2\.\d\d turns"):
        refuse_overlap(resting(0.9), DIAMETER)


def test_a_second_layer_may_cross_the_first_and_not_lie_along_it() -> None:
    def layers(turns: float) -> LayProgram:
        theta = TURN * turns * np.arange(4.0)
        return LayProgram(theta=theta, z=0.018 * turns * np.array([0.0, 1.0, 0.0, 1.0]))

    refuse_overlap(layers(2.25), DIAMETER)
    # After whole turns there and back, the third pass begins where the first one did.
    with pytest.raises(LayProgramError, match="turns would overlap"):
        refuse_overlap(layers(2.0), DIAMETER)


def test_a_program_beyond_the_travel_is_refused() -> None:
    refuse_beyond(even_helix(0.018, 5.0), -0.1, 0.09)
    with pytest.raises(LayProgramError, match=r"90 mm after 5 turns, .* from -100 to 80 mm"):
        refuse_beyond(even_helix(0.018, 5.0), -0.1, 0.08)


def test_a_helix_of_no_turns_is_refused() -> None:
    for turns in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(LayProgramError, match="turns must lie above 0"):
            even_helix(0.018, turns)
    with pytest.raises(LayProgramError, match="pitch must be finite"):
        even_helix(math.nan, 1.0)
    with pytest.raises(LayProgramError, match=r"the program has 0\.5"):
        with_markers_every_turn(even_helix(0.018, 0.5))
