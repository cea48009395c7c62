"""The ways to corrected lengths: put together from the nodes' own records, whole and in parts."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from winding_core.trace import TRACE_DTYPE, Channel, Station, TraceEvent
from winding_reports.run_report.machine_pictures import trace_picture
from winding_reports.trace import LengthTrace, hop_costs, length_trace, write_chrome_trace

TAKEN, PUBLISHED, EXPOSED = TraceEvent.TAKEN, TraceEvent.PUBLISHED, TraceEvent.EXPOSED
# Of each hop [s]; powers of two, so that instants are exact.
HOP = 2.0**-10
BEGIN = 2.0**30


def records(*, lengths: int = 3, slow: dict[str, float] | None = None) -> np.ndarray:
    """Return what nodes note of lengths whose hops all take HOP, but for those that are slow."""
    slow = slow or {}
    rows: list[tuple[float, ...]] = []
    for length in range(lengths):
        stamp, now = 0.02 * length, BEGIN + length
        at: dict[str, float] = {"exposed": now}
        order = (
            "shown", "frame sent", "frame arrived", "frame taken", "markers handed",
            "markers sent", "markers arrived", "markers taken", "markers done",
            "prediction taken", "length handed", "length done",
        )  # fmt: skip
        for name in order:
            now += HOP + slow.get(name, 0.0)
            at[name] = now
        rows += [
            (EXPOSED, Channel.FRAME, Station.RIG, stamp, 0, 0, at["exposed"], at["shown"]),
            (PUBLISHED, Channel.FRAME, Station.RIG, stamp, 0, 0, at["shown"], at["frame sent"]),
            (TAKEN, Channel.FRAME, Station.TRACKER, stamp,
             at["frame sent"], at["frame arrived"], at["frame taken"], at["markers sent"]),
            (PUBLISHED, Channel.TRACKED, Station.TRACKER, stamp, 0, 0,
             at["markers handed"], at["markers sent"]),
            (TAKEN, Channel.TRACKED, Station.CORRECTION, stamp,
             at["markers sent"], at["markers arrived"], at["markers taken"], at["markers done"]),
            (TAKEN, Channel.JOINT_STATES, Station.SOLVER, stamp,
             at["frame sent"], at["frame arrived"], at["frame taken"], at["markers taken"]),
            (PUBLISHED, Channel.PREDICTED, Station.SOLVER, stamp, 0, 0,
             at["markers handed"], at["markers sent"]),
            (TAKEN, Channel.PREDICTED, Station.CORRECTION, stamp,
             at["markers sent"], at["markers arrived"], at["prediction taken"], at["length done"]),
            (PUBLISHED, Channel.CORRECTED, Station.CORRECTION, stamp, 0, 0,
             at["length handed"], at["length done"]),
        ]  # fmt: skip
    return np.array(rows, dtype=TRACE_DTYPE)


def durations(trace: LengthTrace) -> dict[str, np.ndarray]:
    way = trace.camera
    return {f"{hop.station}: {hop.name}": way.durations[:, k] for k, hop in enumerate(way.hops)}


def test_hops_add_up_to_the_way_from_the_exposure_to_the_length() -> None:
    trace = length_trace(records())
    assert trace.lengths == len(trace.camera.stamps) == len(trace.prediction.stamps) == 3
    # Twelve instants follow the exposure.
    np.testing.assert_array_equal(trace.camera.whole, 12 * HOP)
    np.testing.assert_array_equal(trace.camera.durations.sum(axis=1), trace.camera.whole)
    np.testing.assert_array_equal(trace.prediction.durations.sum(axis=1), trace.prediction.whole)


@pytest.mark.parametrize(
    ("late", "hop"),
    [
        ("shown", "camera: expose and read out"),
        ("frame sent", "camera: publish frame"),
        ("frame arrived", "DDS: frame"),
        ("frame taken", "tracker: queue"),
        ("markers handed", "tracker: measure"),
        ("markers sent", "tracker: publish markers"),
        ("markers arrived", "DDS: markers"),
        ("markers taken", "correction: queue"),
        ("markers done", "correction: take markers"),
        ("prediction taken", "correction: wait for prediction"),
        ("length handed", "correction: compute"),
        ("length done", "correction: publish length"),
    ],
)
def test_what_is_late_is_blamed_on_its_hop_alone(late: str, hop: str) -> None:
    slow = 2.0**-5
    usual, found = (durations(length_trace(records(slow=s))) for s in ({}, {late: slow}))
    assert hop in usual
    for name in usual:
        np.testing.assert_array_equal(found[name] - usual[name], slow if name == hop else 0.0)


def test_a_frame_that_waited_for_the_encoder_is_measured_when_the_sample_comes() -> None:
    noted = records(lengths=1)
    frame = (noted["event"] == TAKEN) & (noted["channel"] == Channel.FRAME)
    began = noted["began"][frame][0]
    noted["ended"][frame] = began + 0.25 * HOP
    sample = np.array(
        [(TAKEN, Channel.JOINT_STATES, Station.TRACKER, 0.0, began, began,
          began + 0.5 * HOP, began + 2.0 * HOP)],
        dtype=TRACE_DTYPE,
    )  # fmt: skip
    found = durations(length_trace(np.concatenate([noted, sample])))
    assert found["tracker: wait for encoder"] == 0.5 * HOP
    assert found["tracker: measure"] == 0.5 * HOP


def test_a_driver_that_stamps_by_the_clock_gives_the_exposure_time() -> None:
    noted = records(lengths=1)
    rig = noted["station"] == Station.RIG
    noted["stamp"] = BEGIN - 4 * HOP
    found = durations(length_trace(noted[~rig]))
    # The frame is sent two hops after BEGIN.
    assert found["camera: expose and read out"] == 6 * HOP


@pytest.mark.parametrize("ahead", [64 * HOP, -20 * HOP, 2.5 * HOP], ids=["ahead", "behind", "late"])
def test_frames_of_a_camera_with_a_clock_of_its_own_count_from_their_exposure(ahead: float) -> None:
    noted = records(lengths=4)
    stamped = (noted["channel"] == Channel.FRAME) | (noted["channel"] == Channel.TRACKED)
    # Frame k is exposed at BEGIN + k and sent two hops later.
    noted["stamp"][stamped] = BEGIN + np.round(noted["stamp"][stamped] / 0.02) + ahead
    noted = noted[noted["station"] != Station.RIG]
    # The tracker knows the clock from the third frame on, and half a hop too late.
    known = noted[(noted["channel"] == Channel.FRAME)][2:].copy()
    known["event"], known["sent"], known["arrived"] = EXPOSED, 0.0, 0.0
    known["began"] = known["stamp"] - ahead + 0.5 * HOP
    trace = length_trace(np.concatenate([noted, known]))
    assert len(trace.camera.stamps) == 4
    np.testing.assert_array_equal(trace.camera.whole, 11.5 * HOP)
    # One that seems to be exposed after it was sent was exposed when it was sent.
    known["began"] += 2.0 * HOP
    trace = length_trace(np.concatenate([noted, known]))
    np.testing.assert_array_equal(trace.camera.whole, 10.0 * HOP)


def test_lengths_without_a_frame_have_a_way_from_the_encoder_only(tmp_path: Path) -> None:
    noted = records()
    noted = noted[noted["channel"] != Channel.FRAME]
    trace = length_trace(noted)
    write_chrome_trace(trace, noted, tmp_path / "trace.json")
    written = json.loads((tmp_path / "trace.json").read_text())
    assert written["otherData"] == {"lengths": 3, "camera": 0, "prediction": 3}
    assert hop_costs(trace.camera) == ()
    assert "encoder sample" in trace_picture(trace).caption


def test_a_run_that_begins_again_has_its_own_messages() -> None:
    first, second = records(), records(slow={"frame arrived": HOP})
    for name in ("sent", "arrived", "began", "ended"):
        second[name] += 100.0 * (second[name] > 0.0)
    trace = length_trace(np.concatenate([second, first]))
    np.testing.assert_array_equal(trace.camera.whole, [12 * HOP] * 3 + [13 * HOP] * 3)


def test_shares_are_of_the_mean_whole() -> None:
    *hops, whole = hop_costs(length_trace(records(slow={"markers handed": 12 * HOP})).camera)
    assert sum(hop.share for hop in hops) == pytest.approx(whole.share, rel=1e-12)
    assert whole.median == 24 * HOP
    (blamed,) = (hop for hop in hops if hop.share > 0.5)
    assert (blamed.station, blamed.name) == ("tracker", "measure")


def test_the_file_is_one_that_viewers_of_trace_events_read(tmp_path: Path) -> None:
    noted = records()
    write_chrome_trace(length_trace(noted), noted, tmp_path / "trace.json")
    events = json.loads((tmp_path / "trace.json").read_text())["traceEvents"]
    assert {event["ph"] for event in events} == {"M", "X", "b", "e"}
    named = {event["pid"] for event in events if event["ph"] == "M"}
    assert {event["pid"] for event in events} <= named
    for way in ("camera", "prediction"):
        for number in range(3):
            own = [e for e in events if e.get("cat") == way and e["id"] == number]
            assert own
            begun = [e["name"] for e in own if e["ph"] == "b"]
            assert sorted(begun) == sorted(e["name"] for e in own if e["ph"] == "e")
            hops = [e for e in own if e["name"] != "corrected length"]
            # Hops follow each other without a gap.
            assert all(a["ts"] == b["ts"] for a, b in list(pairwise(hops))[1::2])
    assert all(event["dur"] >= 0.0 for event in events if event["ph"] == "X")


def test_what_two_threads_of_a_node_do_at_once_stands_in_two_rows(tmp_path: Path) -> None:
    noted = np.array(
        [
            (TAKEN, Channel.FRAME, Station.TRACKER, 0.0, BEGIN, BEGIN, BEGIN, BEGIN + 4 * HOP),
            (PUBLISHED, Channel.TRACKED, Station.TRACKER, 0.0, 0, 0, BEGIN + HOP, BEGIN + 2 * HOP),
            (TAKEN, Channel.JOINT_STATES, Station.TRACKER, 0.0, 0, 0, BEGIN + HOP, BEGIN + 5 * HOP),
            (TAKEN, Channel.FRAME, Station.TRACKER, 0.0, 0, 0, BEGIN + 5 * HOP, BEGIN + 6 * HOP),
        ],
        dtype=TRACE_DTYPE,
    )
    write_chrome_trace(length_trace(noted), noted, tmp_path / "trace.json")
    events = json.loads((tmp_path / "trace.json").read_text())["traceEvents"]
    rows = [(event["name"], event["tid"]) for event in events if event["ph"] == "X"]
    assert rows == [
        ("take frame", 1),
        ("publish tracked", 1),
        ("take joint_states", 2),
        ("take frame", 1),
    ]
