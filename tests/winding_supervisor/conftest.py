"""What the machines of these tests are to come to."""

from dataclasses import replace

import pytest

from cable_fem_node.winding.prediction import predict
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.cases import paper_case

PULL = 1.96  # What the load cells of the example drivers say [N]


@pytest.fixture(scope="session")
def predicted_p1() -> float:
    """Length of P1 that the solver finds ahead of a run of the example drivers [m]."""
    case = replace(paper_case(4), weight=PULL)
    return float(predict(WindingConfig(case=case), duration=5.0).markers["s"][1])
