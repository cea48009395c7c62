"""Winding a run with a live picture on a terminal or with lines in a log; how it may end early."""

import math
import sys
from collections.abc import Callable
from functools import partial
from importlib import import_module
from threading import Thread
from typing import NoReturn

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from winding_cli.run.delivery import RunDelivery
from winding_cli.terminal.console import Shown, record_table
from winding_cli.terminal.refusal import FAILED, complain, fail, refused
from winding_cli.terminal.termination import end
from winding_core.cable.cases import Case
from winding_core.cable.condition import Condition
from winding_core.markers import is_wound
from winding_core.run_outcome import EndedBy
from winding_core.units import MILLIMETRE
from winding_recorder.live.recorder import RecorderError
from winding_recorder.live.run_buffer import RunBuffer
from winding_ros import topics
from winding_ros.graph import GraphError
from winding_ros.topic import Topic
from winding_supervisor.session.domain_lock import DomainError
from winding_supervisor.session.run import Run, opened_run
from winding_supervisor.session.run_config import RunConfig, RunFolderError

_FIRST_WORDS = "starting the nodes; the first start after an install compiles kernels for a minute"


def wind(config: RunConfig, delivery: RunDelivery) -> Callable[[], NoReturn] | None:
    """Wind with a live picture on a terminal, and with lines of progress elsewhere.

    Returns:
        How the command is to end if it ended early.
    """
    interrupted = partial(end, "interrupted; the nodes are stopped")
    ending: Callable[[], NoReturn] | None = None
    with (
        refused(DomainError, RecorderError, RunFolderError),
        refused(OSError, code=FAILED),
        opened_run(config) as run,
    ):
        delivery.begin(run.config.directory)
        # Beside everything else; whoever imports it later waits for that.
        Thread(target=import_module, args=("winding_reports.run_report.report",)).start()
        try:
            _watch(run, config.spec.condition, delivery)
        except (GraphError, TimeoutError, OSError) as error:
            complain(error)
            ending = fail
        except KeyboardInterrupt:
            ending = interrupted
        for result in run.remains():
            delivery.deliver(result)
            if result.ending.by is EndedBy.SIGNAL:
                ending = interrupted
    # A machine that may still turn is more than an interruption.
    return None if ending is interrupted and delivery.flawed else ending


def _watch(run: Run, condition: Condition, delivery: RunDelivery) -> None:
    console = Console(stderr=True)
    if not console.is_terminal:
        print(_FIRST_WORDS, file=sys.stderr, flush=True)
        printed = 0

        def line(buffer: RunBuffer, wall: float) -> None:
            """Print for a log how far the run has come, at every tenth of it."""
            nonlocal printed
            t = buffer.time
            tenth = int(10.0 * t / condition.duration)
            if tenth > printed:
                printed = tenth
                print(
                    f"{t:6.2f} of {condition.duration:.2f} s simulated, {wall:.1f} s on the clock",
                    file=sys.stderr,
                    flush=True,
                )

        run.wind(line, partial(print, flush=True), delivery.deliver)
        return
    with Live(Text(_FIRST_WORDS), console=console, transient=True) as live:

        def view(buffer: RunBuffer, wall: float) -> None:
            live.update(_picture(condition, buffer, wall))

        run.wind(view, live.console.print, delivery.deliver)


def _picture(condition: Condition, buffer: RunBuffer, wall: float) -> RenderableType:
    """Return the newest state of a run, `wall` seconds after its start."""
    reading = buffer.newest_axis_reading()
    if reading is None:
        return Text("waiting for the first encoder sample")
    _, measured = reading
    t = buffer.time
    wanted = buffer.newest(topics.JOINT_COMMANDS)
    tension = buffer.newest(topics.TENSION)
    machine = Table.grid(padding=(0, 2))
    machine.add_row(
        "simulated",
        f"{t:6.2f} of {condition.duration:.2f} s",
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
    machine.add_row("tension", f"{tension:6.3f} N" if tension is not None else "-")
    bar = ProgressBar(total=condition.duration, completed=min(t, condition.duration), width=60)
    return Group(bar, machine, _lengths(condition.resolved().case, buffer))


def _lengths(case: Case, buffer: RunBuffer) -> Table:
    columns = [
        Shown("marker", lambda marker: f"P{marker}"),
        Shown("original mm", case.original_length, ".1f", MILLIMETRE),
    ]
    for name, topic in (
        ("predicted", topics.FEM_MARKERS),
        ("measured", topics.TRACKED_MARKERS),
        ("corrected", topics.CORRECTED_MARKERS),
    ):
        length = _markers(buffer, topic).get
        columns.append(Shown(f"{name} mm", length, ".1f", MILLIMETRE, "not wound"))
    markers = range(1, case.marker_count + 1)
    return record_table(columns, markers, words=1, box=None, padding=(0, 2))


def _markers(buffer: RunBuffer, topic: Topic) -> dict[int, float]:
    markers = buffer.newest(topic)
    if markers is None:
        return {}
    wound = markers[is_wound(markers)]
    return dict(zip(wound["id"].tolist(), wound["s"].tolist(), strict=True))
