"""A signal whose handler raises while the solver is at work, as Ctrl-C in a notebook does."""

import pytest

from processes import python

# The handler runs at the first line of Python after the kernel: its exception must arrive there.
PROGRAM = """
import signal
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.solid_winding import SolidWinding
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.cases import paper_case
from winding_core.machine.drive import DriveProfile

class InterruptedError(Exception):
    pass

def interrupt(*_):
    raise InterruptedError

signal.signal(signal.SIGVTALRM, interrupt)
drive, interrupted = DriveProfile(), 0
make = {make}
for _ in range(20):
    model, t = make(), 0.0
    model.compile()
    signal.setitimer(signal.ITIMER_VIRTUAL, 0.05)
    try:
        while True:
            t += {step}
            model.advance_to(t, drive.reading_at(t))
    except InterruptedError:
        interrupted += 1
print(interrupted)
"""
ROD = "lambda: RodWinding(WindingConfig(case=paper_case(4)))"
SOLID = "lambda: SolidWinding(WindingConfig(case=paper_case(4), segment_length=4.0e-3), wind=0.5)"


@pytest.mark.parametrize(("make", "step"), [(ROD, 0.02), (SOLID, 1.0e-4)])
def test_what_a_signal_raises_arrives_and_ends_no_interpreter(make: str, step: float) -> None:
    program = PROGRAM.format(make=make, step=step)
    done = python(program)
    assert (done.returncode, done.stdout) == (0, "20\n"), done.stderr
