"""The picture of a run on a terminal, while it goes on."""

from __future__ import annotations

import math
from functools import partial

from rich.console import Group, RenderableType
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from winding_core.cable.cases import Case
from winding_core.markers import CORRECTED_DTYPE, MARKER_DTYPE, is_wound
from winding_core.units import MILLIMETRE
from winding_recorder.live.run_buffer import RunBuffer
from winding_ros import topics
from winding_ros.messages.clouds import decode_cloud
from winding_ros.messages.rig import decode_joint_state, decode_tension
from winding_ros.topic import Topic


class LiveView:
    """Draws the newest state of a run from its buffer."""

    def __init__(self, case: Case, duration: float, buffer: RunBuffer) -> None:
        self._case = case
        self._duration = duration
        self._buffer = buffer

    def render(self, wall: float) -> RenderableType:
        """Return the present picture, `wall` seconds after the start."""
        reading = self._buffer.newest_axis_reading()
        if reading is None:
            return Text("waiting for the first encoder sample")
        _, measured = reading
        t = self._buffer.time
        command = self._buffer.newest(topics.JOINT_COMMANDS, decode_joint_state)
        wanted = command[1] if command is not None else None
        tension = self._buffer.newest(topics.TENSION, decode_tension)
        machine = Table.grid(padding=(0, 2))
        machine.add_row(
            "simulated",
            f"{t:6.2f} of {self._duration:.2f} s",
            f"x{t / wall:.2f} of real time" if wall > 0.0 else "",
        )
        machine.add_row(
            "cylinder",
            f"{measured.angular_speed:6.3f} rad/s",
            f"target {wanted.angular_speed:.3f}" if wanted else "",
            f"{measured.cylinder_angle / (2.0 * math.pi):.2f} turns",
        )
        machine.add_row(
            "carriage",
            f"{measured.feed_speed / MILLIMETRE:6.3f} mm/s",
            f"target {wanted.feed_speed / MILLIMETRE:.3f}" if wanted else "",
            f"{measured.carriage_position / MILLIMETRE:.1f} mm",
        )
        machine.add_row("tension", f"{tension[1]:6.3f} N" if tension is not None else "-")
        bar = ProgressBar(total=self._duration, completed=min(t, self._duration), width=60)
        return Group(bar, machine, self._lengths())

    def _lengths(self) -> Table:
        table = Table("marker", box=None, padding=(0, 2))
        for name in ("original", "predicted", "measured", "corrected"):
            table.add_column(f"{name} mm", justify="right")
        fem = self._markers(topics.FEM_MARKERS)
        tracked = self._markers(topics.TRACKED_MARKERS)
        corrected = self._markers(topics.CORRECTED_MARKERS)
        for marker in range(1, self._case.marker_count + 1):
            table.add_row(
                f"P{marker}",
                f"{self._case.original_length(marker) / MILLIMETRE:.1f}",
                *(_length(markers, marker) for markers in (fem, tracked, corrected)),
            )
        return table

    def _markers(self, topic: Topic) -> dict[int, float]:
        dtype = CORRECTED_DTYPE if topic is topics.CORRECTED_MARKERS else MARKER_DTYPE
        newest = self._buffer.newest(topic, partial(decode_cloud, dtype=dtype))
        if newest is None:
            return {}
        _, markers = newest
        return {
            int(marker): float(length)
            for marker, length in zip(
                markers["id"][is_wound(markers)], markers["s"][is_wound(markers)], strict=True
            )
        }


def _length(markers: dict[int, float], marker: int) -> str:
    return f"{markers[marker] / MILLIMETRE:.1f}" if marker in markers else "not wound"
