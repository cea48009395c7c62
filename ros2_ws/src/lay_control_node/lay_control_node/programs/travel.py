"""Programs that leave the carriage's travel."""

from __future__ import annotations

import numpy as np

from lay_control_node.programs.points import FULL_TURN
from winding_core.lay.program import LayProgram, LayProgramError
from winding_core.units import MILLIMETRE


def refuse_beyond(program: LayProgram, low: float, high: float) -> None:
    """Refuse a program that wants cable where the guide cannot go.

    Args:
        program: The program.
        low: Start of the carriage's travel [m].
        high: Its end [m].

    Raises:
        LayProgramError: A point lies outside; says which.
    """
    beyond = np.maximum(low - program.z, program.z - high)
    worst = int(np.argmax(beyond))
    if beyond[worst] > 0.0:
        raise LayProgramError(
            f"the program wants the cable at {program.z[worst] / MILLIMETRE:g} mm after "
            f"{program.theta[worst] / FULL_TURN:.3g} turns, the carriage travels from "
            f"{low / MILLIMETRE:g} to {high / MILLIMETRE:g} mm"
        )
