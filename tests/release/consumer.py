"""A program of a user who installed the wheel: what it takes from the package has types."""

from typing import assert_type

import cable_winding as cw


def wound_ahead(case: int) -> cw.Prediction:
    """Return what a published case winds in its first half second."""
    condition = cw.Condition(case=case, duration=0.5)
    assert_type(condition.friction, float)
    return cw.predict(condition)


if __name__ == "__main__":
    print(f"{wound_ahead(4).energy_balance:.5f}")
