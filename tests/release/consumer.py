"""A program of somebody who installed the wheel: what it takes from the packages has types."""

from typing import assert_type

from cable_fem_node.winding.prediction import Prediction, predict
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.condition import Condition, ResolvedCondition


def wound_ahead(case: int) -> Prediction:
    """Return what a published case winds in its first half second."""
    resolved = Condition(case=case, duration=0.5).resolved()
    assert_type(resolved, ResolvedCondition)
    config = WindingConfig(case=resolved.case, tension_law=resolved.tension_law)
    assert_type(config.friction, float)
    return predict(config, resolved.drive, resolved.duration)


if __name__ == "__main__":
    print(f"{wound_ahead(4).energy.balance_pct:.3f}")
