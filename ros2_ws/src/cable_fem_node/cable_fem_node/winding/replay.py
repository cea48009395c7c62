"""A model taken along the inputs of a run."""

from __future__ import annotations

from collections.abc import Callable

from cable_fem_node.winding.winding_model import WindingModel
from winding_core.run_inputs import Inputs, RunInputs


class AbandonedError(RuntimeError):
    """A replay was no longer wanted."""


def replay(inputs: Inputs, model: WindingModel, going: Callable[[], bool] = lambda: True) -> None:
    """Advance a model from its own time along inputs, shape (n,) of INPUT_DTYPE.

    Args:
        inputs: Ascending in time.
        model: What is advanced.
        going: Asked before every step whether the result is still wanted.

    Raises:
        AbandonedError: `going` said no.
    """
    for t, reading, tension in RunInputs(samples=inputs[inputs["t"] > model.time]):
        if not going():
            raise AbandonedError(f"the replay was abandoned at t = {model.time:.6g} s")
        model.advance_to(t, reading, tension)
