"""The kernels are valid Python: the same numbers come out with compilation disabled."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

SCRIPT = """
import json
import numpy as np
from winding_verification.rod.rod import Rod
from winding_verification.rod.rod import RodSection
from cable_fem_node.solid.solid import Solid
from cable_fem_node.solid.solid_law import SolidLaw
from cable_fem_node.solid.solid_mesh import block
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.cases import paper_case
from winding_core.machine.readings import AxisReading

line = np.column_stack([np.linspace(0.0, 0.02, 5), np.zeros(5), np.zeros(5)])
rod = Rod(line, RodSection(diameter=4e-3, law="neo_hookean"), twist=True)
rod.clamp("start")
rod.apply(4, (0.0, 0.1, 0.05))
rod.advance(2e-3)
nodes, hexes = block([2e-3, 1e-3, 1e-3], (2, 1, 1))
solid = Solid(nodes, hexes, SolidLaw(law="hencky"))
solid.fix(range(4))
solid.apply(range(8, 12), (0.2, 0.1, 0.0))
solid.advance(5e-5)
model = RodWinding(WindingConfig(case=paper_case(4), segment_length=9e-3))
model.advance_to(0.03, AxisReading(
    cylinder_angle=0.02, angular_speed=0.7, carriage_position=1e-4, feed_speed=3e-3
))
print(json.dumps([rod.nodes.tolist(), solid.nodes.tolist(), model.cable()["x"].tolist(),
                  [model.energy.internal, model.energy.external, model.energy.damping]]))
"""


def outcome(**environment):
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
def test_interpreted_kernels_give_the_compiled_numbers():
    for compiled, interpreted in zip(outcome(), outcome(NUMBA_DISABLE_JIT="1"), strict=True):
        # Compiled sums are reordered: rounding of a few hundred steps remains.
        assert np.asarray(interpreted) == pytest.approx(np.asarray(compiled), rel=1e-9, abs=1e-12)
