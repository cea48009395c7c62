"""How a running graph does: rates, latency from frame to corrected length, load of each process."""

from collections.abc import Mapping

import numpy as np
import psutil  # type: ignore[import-untyped]

from winding_core.status import Level
from winding_recorder.live.run_buffer import BufferedMessage, RunBuffer
from winding_ros import topics
from winding_ros.topic import Topic

_FRAME_PERIOD_NS = 5_000_000
_MEBIBYTE = 2.0**20


class LoadMonitor:
    """Measures what has come since the last look."""

    def __init__(self, buffer: RunBuffer) -> None:
        self.buffer = buffer  # Messages of the graph so far
        self.lost_frames = 0  # Frames missing between those that came, since the beginning
        self._seen: dict[str, int] = {
            name: messages.taken for name, messages in buffer.messages.items()
        }
        self._last: float | None = None
        self._processes: dict[str, psutil.Process] = {}

    def look(self, now: float, pids: Mapping[str, int]) -> tuple[Level, str, dict[str, str]]:
        """Return level, sentence and values at wall time `now` [s]."""
        span = now - self._last if self._last is not None else 0.0
        self._last = now
        values = self._latency()
        before = self.lost_frames
        self.lost_frames += self._frame_gaps()
        for name, messages in self.buffer.messages.items():
            count = messages.taken
            fresh = count - self._seen[name]
            self._seen[name] = count
            if span > 0.0:
                values[f"rate {name} [1/s]"] = f"{fresh / span:.0f}"
        values["lost frames"] = str(self.lost_frames)
        values |= self._load(pids)
        if self.lost_frames > before:
            return Level.WARN, f"{self.lost_frames - before} frames are missing", values
        return Level.OK, "", values

    def _fresh(self, topic: Topic, overlap: int = 0) -> list[BufferedMessage]:
        messages = self.buffer.messages[topic.name]
        return messages.newest(messages.taken - self._seen[topic.name] + overlap)

    def _latency(self) -> dict[str, str]:
        """Return median and 99th percentile of the wall time from a frame's instant to its length.

        The instant is that of the encoder sample with the same stamp: a corrected length does not
        wait for its picture, which may come later.
        """
        # A corrected length may follow an instant of before the last look.
        sent = {
            sample.stamp_ns: sample.sent_ns for sample in self._fresh(topics.JOINT_STATES, 1000)
        }
        waits = [
            1.0e-6 * (length.received_ns - sent[length.stamp_ns])
            for length in self._fresh(topics.CORRECTED_MARKERS)
            if length.stamp_ns in sent
        ]
        if not waits:
            return {}
        return {
            "frame to corrected length p50 [ms]": f"{np.percentile(waits, 50):.1f}",
            "frame to corrected length p99 [ms]": f"{np.percentile(waits, 99):.1f}",
        }

    def _frame_gaps(self) -> int:
        stamps = [frame.stamp_ns for frame in self._fresh(topics.CAMERA_INFO, overlap=1)]
        steps = np.diff(np.array(stamps, dtype=np.int64))
        gaps = np.rint(steps[steps > 0] / _FRAME_PERIOD_NS).astype(int) - 1
        return int(gaps.clip(min=0).sum())

    def _load(self, pids: Mapping[str, int]) -> dict[str, str]:
        values = {}
        for name, pid in pids.items():
            try:
                process = self._processes.get(name)
                known = process is not None and process.pid == pid
                if process is None or not known:
                    process = self._processes[name] = psutil.Process(pid)
                # The first call begins the span that the second one measures.
                share = process.cpu_percent()
                if known:
                    values[f"cpu {name} [%]"] = f"{share:.0f}"
                values[f"memory {name} [MiB]"] = f"{process.memory_info().rss / _MEBIBYTE:.0f}"
            except psutil.NoSuchProcess:
                self._processes.pop(name, None)
        return values
