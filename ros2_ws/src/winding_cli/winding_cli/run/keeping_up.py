"""Whether the solver of a live run can keep up with the machine, told before anything moves."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING, Any

from cable_fem_node.dynamics.state import SolverError
from cable_fem_node.ros.parameters import FemParameters
from cable_fem_node.winding.expected_cost import falling_behind
from winding_cli.terminal.console import busy
from winding_core.parameters import build
from winding_ros.topics import FEM

if TYPE_CHECKING:
    from winding_supervisor.session.run_config import RunConfig


def warn_of_slowness(config: RunConfig) -> None:
    """Print on stderr when the solver may fall behind, with a mass scaling that helps.

    A simulated machine that follows its slowest consumer waits for it.
    """
    spec = config.spec
    pace = 1.0 if spec.external else spec.machine.speed
    values = config.parameters().get(FEM)
    if values is None or not pace:
        return
    wanted: Any = build(FemParameters, values, owner=FEM)
    if wanted.element != "rod":
        # Simulated time waits for the solid.
        return
    with busy("estimating the time"):
        try:
            sentence = falling_behind(wanted.in_step(), time.process_time, pace=pace)
        except (SolverError, ValueError):
            # The node refuses it as it is configured, with the same sentence.
            return
    if sentence:
        print(f"doubtful: {sentence}", file=sys.stderr, flush=True)
