"""Winding a run under the eyes of a terminal or of a log, and how it may end early."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, NoReturn

from winding_cli.commands.refusal import FAILED, complain, fail, refuse
from winding_cli.commands.run_checks import check_before_start
from winding_cli.commands.termination import end
from winding_cli.output.progress_lines import ProgressLines, print_sentence
from winding_core.condition import Condition

if TYPE_CHECKING:
    from winding_cli.commands.run_delivery import RunDelivery
    from winding_recorder.live.recorder import RunBuffer
    from winding_supervisor.run import Run
    from winding_supervisor.run_config import RunConfig
    from winding_supervisor.run_result import RunResult

_FIRST_WORDS = "starting the nodes; the first start after an install compiles kernels for a minute"


def wind(
    config: RunConfig, condition: Condition, delivery: RunDelivery
) -> Callable[[], NoReturn] | None:
    """Wind with a live picture on a terminal, and with lines of progress elsewhere.

    Args:
        config: Of the run.
        condition: What is wound, as far as the command line says.
        delivery: Takes what every run leaves.

    Returns:
        How the command is to end if it ended early.
    """
    from winding_cli.output.early_import import import_early
    from winding_recorder.live.recorder import RecorderError
    from winding_ros.graph_error import GraphError
    from winding_supervisor.domain_lock import DomainError
    from winding_supervisor.run import opened_run
    from winding_supervisor.run_config import RunFolderError

    check_before_start(config)
    ending: Callable[[], NoReturn] | None = None
    results: list[RunResult] = []
    try:
        with opened_run(config) as run:
            delivery.begin(run.config.directory)
            import_early("winding_reports.run_report.report")
            try:
                results += filter(None, [_watched(run, config, condition, delivery)])
            except (GraphError, TimeoutError, OSError) as error:
                reason = str(error)
                complain(reason)
                ending = fail
            except KeyboardInterrupt:
                reason = "interrupted"
                ending = partial(end, "interrupted; the nodes are stopped")
            if ending is not None:
                results = run.remains(reason)
    except (DomainError, RecorderError, RunFolderError) as error:
        refuse(error)
    except OSError as error:
        refuse(error, FAILED)
    for result in results:
        delivery.deliver(result)
    return ending


def _watched(
    run: Run, config: RunConfig, condition: Condition, delivery: RunDelivery
) -> RunResult | None:
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    from winding_cli.output.live_view import LiveView

    console = Console(stderr=True)
    if not console.is_terminal:
        lines = ProgressLines(config.duration, _FIRST_WORDS)
        return run.wind(lines, print_sentence, delivery.deliver)
    with Live(Text(_FIRST_WORDS), console=console, transient=True) as live:

        def view(buffer: RunBuffer, wall: float) -> None:
            picture = LiveView(condition.resolved().case, config.duration, buffer)
            live.update(picture.render(wall))

        return run.wind(view, live.console.print, delivery.deliver)
