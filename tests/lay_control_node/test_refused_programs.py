"""Programs that cannot be wound: one sentence with the value, the limit and the line."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from lay_control_node.programs import (
    even_helix,
    read_program,
    refuse_beyond,
    refuse_overlap,
    with_markers_every_turn,
)
from lay_control_node.programs.reading import MOST_BYTES
from winding_core.lay_program import LayProgram, LayProgramError

TURN = 2.0 * math.pi
RADIUS = 0.0215
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
        (
            "segments: [{reverse_at: {z_mm: [5, 20], pitch_mm: 18, turns: 3}}]",
            "hold the 0 mm where the cable lies, got 5 to 20 mm",
        ),
        (
            "segments: [{reverse_at: {z_mm: [0, 0.001], pitch_mm: 1000, turns: 9999}}]",
            "at most 100000 points",
        ),
        (
            "segments: [{cosine: {mean_pitch_mm: 9, amplitude_mm: 1, period_turns: 0, turns: 1}}]",
            "period_turns must be at least 0.01",
        ),
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
        ("G1 A10 A20 X1\n", "says A twice"),
    ],
}


@pytest.mark.parametrize(
    ("name", "text", "sentence"),
    [(name, text, sentence) for name, items in REFUSED.items() for text, sentence in items],
)
def test_a_program_that_says_nothing_usable_is_refused(
    tmp_path: Path, name: str, text: str, sentence: str
) -> None:
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
