"""The solver's node with runs that are longer than one piece of a prediction or one message."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rods import CONFIG, DRIVE
from solver_bench import SolverBench

from cable_fem_node.ros import message_handler
from cable_fem_node.ros.message_handler import FemHandler
from cable_fem_node.ros.parameters import FemParameters
from cable_fem_node.winding.prediction import predict
from cable_fem_node.winding.run_ahead import PIECE
from winding_core.markers import CABLE_DTYPE, MARKER_DTYPE, Markers, is_wound
from winding_ros import topics
from winding_ros.cloud_messages import decode_cloud
from winding_ros.rig_messages import encode_joint_state

LONG = PIECE + 4.0


def predicted(answers: Any) -> list[tuple[float, Markers]]:
    return [decode_cloud(answer.data, MARKER_DTYPE) for answer in answers]


@pytest.mark.slow
def test_run_is_predicted_in_pieces_and_ends_as_the_whole() -> None:
    handler = FemHandler(FemParameters(case=4, duration=LONG), ahead_elsewhere=True)
    # What configuring waits for is the first piece, however long the run is.
    assert handler.ahead.model.time == pytest.approx(PIECE, abs=0.02)
    assert not handler.ahead.done
    ((t, first),) = predicted(handler.begin(7.0))
    assert t == 7.0
    assert is_wound(first).all()
    list(handler.ahead.wind_on())
    (_, early), (_, last) = predicted(handler.begin(8.0))
    np.testing.assert_array_equal(early, first)
    whole = predict(CONFIG, duration=LONG).markers
    for name in ("theta", "z", "s", "flags"):
        np.testing.assert_array_equal(last[name], whole[name])


@pytest.mark.slow
def test_handler_that_is_alone_yields_the_whole_prediction_at_once() -> None:
    handler = FemHandler(FemParameters(case=4, duration=LONG))
    assert len(predicted(handler.begin(0.0))) == 2
    assert handler.ahead.done


def test_run_of_an_hour_is_configured_after_its_first_piece() -> None:
    handler = FemHandler(FemParameters(case=4, duration=3600.0), ahead_elsewhere=True)
    assert handler.ahead.model.time <= PIECE + 0.02


def test_stiff_cable_is_configured_after_part_of_a_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(message_handler, "FIRST_STEPS", 1.0e5)
    handler = FemHandler(FemParameters(case=4, duration=LONG), ahead_elsewhere=True)
    assert 0.0 < handler.ahead.model.time < 1.0
    assert predicted(handler.begin(0.0)) == []


@pytest.mark.slow
def test_node_publishes_the_rest_of_a_prediction_by_itself(ros: Any) -> None:
    bench = SolverBench(ros, duration=LONG)
    bench.wait_for(topics.FEM_PREDICTION, 2)
    (t, first), (t2, last) = bench.markers(topics.FEM_PREDICTION)
    # Both are made from what was known when the run began.
    assert t == t2
    np.testing.assert_allclose(first["s"], last["s"], rtol=0.0, atol=1.0e-5)
    assert bench.node.status().values["predicted_to"] == f"{LONG:.1f}"
    bench.begin_anew()
    # A new run, the same plan: nothing is wound again.
    bench.wait_for(topics.FEM_PREDICTION, 4)


def merged(known: np.ndarray, news: np.ndarray) -> np.ndarray:
    """Return the cable as docs/interfaces.md has it: old turns have turned with the cylinder."""
    old = known[known["s"] < news["s"][0]].copy()
    if old.size:
        (same,) = known[known["s"] == news["s"][0]]
        apart = np.arctan2(news["y"][0], news["x"][0]) - np.arctan2(same["y"], same["x"])
        c, s = np.cos(apart), np.sin(apart)
        old["x"], old["y"] = c * old["x"] - s * old["y"], s * old["x"] + c * old["y"]
    return np.concatenate([old, news])


def test_messages_of_the_newest_turns_make_up_the_whole_cable(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(message_handler, "_CABLE_TURNS", 0.5)
    handler = FemHandler(
        FemParameters(case=4, duration=0.5, follow_tension=False), ahead_elsewhere=True
    )
    list(handler.begin(0.0))
    known, sizes = np.zeros(0, dtype=CABLE_DTYPE), []
    for sample in range(1501):
        t = 0.01 * sample
        for answer in handler.take(topics.JOINT_STATES, encode_joint_state(t, DRIVE.reading_at(t))):
            if answer.topic is topics.FEM_CABLE:
                news = decode_cloud(answer.data, CABLE_DTYPE)[1]
                sizes.append(news.size)
                known = merged(known, news)
    assert handler.model is not None
    whole = handler.model.cable()
    # The free span, what stays awake, and half a turn; a fifth more rests from time to time.
    assert max(sizes[200:]) < whole.size - 20
    assert known.size == whole.size
    np.testing.assert_array_equal(known["s"], whole["s"])
    np.testing.assert_allclose(known["tension"], whole["tension"], rtol=1.0e-3)
    for name in "xyz":
        # Single precision, turned three hundred times.
        np.testing.assert_allclose(known[name], whole[name], rtol=0.0, atol=1.0e-6)
