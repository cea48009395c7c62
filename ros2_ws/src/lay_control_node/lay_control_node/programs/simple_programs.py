"""Programs that need no file: one helix, and markers that land on whole turns."""

import dataclasses
import math

import numpy as np

from lay_control_node.programs.points import FULL_TURN, MOST_TURNS
from winding_core.lay.program import LayProgram, LayProgramError

_ROUNDING = 1.0e-9


def even_helix(pitch: float, turns: float, *, name: str = "even helix") -> LayProgram:
    """Return a helix of one pitch from P0 on.

    Args:
        pitch: Axial advance of a turn [m]; negative winds towards smaller z.
        turns: Count of turns.
        name: As reports write it.

    Raises:
        LayProgramError: The pitch is not finite, or there are no turns or too many.
    """
    if not math.isfinite(pitch):
        raise LayProgramError(f"the pitch must be finite, got {pitch}")
    if not 0.0 < turns <= MOST_TURNS:
        raise LayProgramError(f"turns must lie above 0 and up to {MOST_TURNS:g}, got {turns:g}")
    return LayProgram(
        theta=np.array([0.0, FULL_TURN * turns]), z=np.array([0.0, pitch * turns]), name=name
    )


def with_markers_every_turn(program: LayProgram, count: int | None = None) -> LayProgram:
    """Return a program whose marker n is wanted after n turns, as far as the program goes.

    Args:
        program: The program.
        count: Of markers on the cable; None for as many as there are turns.

    Raises:
        LayProgramError: It states already where markers are wanted, or it has no whole turn.
    """
    if program.markers:
        raise LayProgramError("the program states already where its markers are wanted")
    turns = math.floor(program.end / FULL_TURN + _ROUNDING)
    if turns < 1:
        raise LayProgramError(
            f"markers on every turn need a turn, the program has {program.end / FULL_TURN:g}"
        )
    last = turns if count is None else min(turns, count)
    angles = {n: min(FULL_TURN * n, program.end) for n in range(1, last + 1)}
    return dataclasses.replace(program, markers=angles)
