"""Flow control: simulated time never outruns its slowest reader."""

import math

import pytest

from winding_rig_node.machine.pace import Pace


def test_without_consumers_time_is_free() -> None:
    assert Pace([], 0.1).limit == math.inf


def test_limit_follows_the_slowest_consumer() -> None:
    pace = Pace(["a", "b"], 0.25)
    pace.answer("a", 5.0)
    pace.answer("b", 1.0)
    assert pace.limit == pytest.approx(1.25)
    assert pace.slowest == "b"


def test_a_stale_answer_does_not_take_time_back() -> None:
    pace = Pace(["a"], 0.25)
    pace.answer("a", 2.0)
    pace.answer("a", 1.0)
    assert pace.limit == pytest.approx(2.25)


def test_zero_lead_is_refused() -> None:
    with pytest.raises(ValueError, match=r"max_lead must be positive, got 0\.0 s"):
        Pace(["a"], 0.0)
