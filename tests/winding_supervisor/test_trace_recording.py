"""What a run keeps of its nodes' traces."""

import time
from typing import Any

import numpy as np
import pytest

from winding_core.trace import TRACE_DTYPE, Channel, Station, TraceEvent
from winding_ros import topics
from winding_ros.messages.clouds import encode_cloud
from winding_supervisor.session.run_parts import TraceRecording


class Bench:
    """A recording, and a node that notes."""

    def __init__(self, ros: Any) -> None:
        node, self.ros = ros.plain(), ros
        self.publisher = topics.TRACE.advertise(node)
        self.recording = TraceRecording(ros.plain("recorder_host"))
        ros.spin_until(lambda: self.publisher.get_subscription_count() == 1)

    def note(self, **fields: float) -> None:
        """Note a frame that was taken now, odd in some fields."""
        record = np.zeros(1, TRACE_DTYPE)
        record["event"], record["channel"] = TraceEvent.TAKEN, Channel.FRAME
        record["station"] = Station.TRACKER
        record["began"] = record["ended"] = time.time()
        for name, value in fields.items():
            record[name] = value
        self.publisher.publish(encode_cloud(0.0, record))

    def stamps(self, since: int, count: int) -> list[float]:
        """Return the stamps of the records since a monotonic time [ns], once there are so many."""
        self.ros.spin_until(lambda: len(self.recording.since(0)) == count)
        return [float(stamp) for stamp in self.recording.since(since)["stamp"]]


@pytest.fixture
def bench(ros: Any) -> Bench:
    return Bench(ros)


def test_an_earlier_run_of_the_same_nodes_is_left_out(bench: Bench) -> None:
    # An operator's next run begins at simulated time 0 again, or goes on.
    bench.note(stamp=1.0, began=time.time() - 60.0, ended=time.time() - 59.0)
    bench.note(stamp=2.0)
    assert bench.stamps(time.monotonic_ns() - 30_000_000_000, 2) == [2.0]


@pytest.mark.parametrize("odd", [{"event": 9}, {"channel": 9}, {"station": 4}, {"began": np.nan}])
def test_a_record_that_says_nothing_is_left_out(bench: Bench, odd: dict[str, float]) -> None:
    bench.note(stamp=1.0, **odd)
    bench.note(stamp=2.0)
    assert bench.stamps(0, 1) == [2.0]
