"""The rod wound along a run's inputs until the tracked markers have landed."""

import dataclasses
import math
from collections.abc import Callable

from cable_fem_node.dynamics.state import FloatArray, SolverError
from cable_fem_node.identification.quasi_static import strain
from cable_fem_node.identification.tracked_run import IdentificationError, TrackedRun
from cable_fem_node.winding.prediction import refuse_open_balance
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.run_ahead import replay
from winding_core.cable.material_law import MaterialLaw
from winding_core.markers import is_wound
from winding_core.run_inputs import continued_inputs

# A marker is read once the cylinder has turned this much further [rad]: its landing has calmed.
_SETTLED = 0.25
# How far beyond the closed form's angle a marker may land: the two differ by a percent.
_LATEST = 1.05
# An element lies on the cylinder at most this many segment lengths long: a soft cable's elements
# grow, and from 1.15 to 1.6 the error of its angles grows from 0.08 to 0.4 percent.
_LONGEST = 1.15


def wind(
    run: TrackedRun,
    law: MaterialLaw,
    expected: FloatArray,
    going: Callable[[], bool] = lambda: True,
) -> tuple[FloatArray, FloatArray]:
    """Return (theta [rad], z [m]) of the run's markers on the rod, shape (m,) each.

    Args:
        run: Inputs and markers.
        law: The material that is tried.
        expected: Wound angles of the closed form [rad], shape (m,).
        going: Returns whether the result is still wanted; called before every step.

    Raises:
        IdentificationError: A marker does not land, or the rod fails.
        AbandonedError: `going` returned False.
    """
    latest = _LATEST * float(expected[-1]) + _SETTLED + math.pi / 4.0
    inputs = continued_inputs(run.inputs, latest)
    early = inputs["cylinder_angle"] < float(expected[-1])
    try:
        config = run.config.with_law(law)
        segment = config.resolved.segment * min(1.0, _LONGEST / (1.0 + strain(run, law)))
        model = RodWinding(dataclasses.replace(config, segment_length=segment))
        replay(inputs[early], model, going)
        wound_at = math.inf
        for i in range(int(early.sum()), inputs.size):
            replay(inputs[i : i + 1], model, going)
            if is_wound(model.markers()[run.readings.ids]).all():
                wound_at = min(wound_at, model.cylinder_angle)
            if model.cylinder_angle >= wound_at + _SETTLED:
                break
        refuse_open_balance(model.energy, model.time)
    except (SolverError, ValueError) as error:
        raise IdentificationError(
            f"the rod fails with a modulus of {law.young:.4g} Pa: {error}"
        ) from error
    markers = model.markers()[run.readings.ids]
    landed = is_wound(markers)
    if not landed.all():
        late = int(run.readings.ids[~landed][0])
        raise IdentificationError(
            f"P{late} does not land by {model.cylinder_angle:.4g} rad with a modulus of "
            f"{law.young:.4g} Pa"
        )
    return markers["theta"].astype(float), markers["z"].astype(float)
