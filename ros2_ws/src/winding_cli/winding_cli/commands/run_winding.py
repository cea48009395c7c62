"""Winding a run under the eyes of a terminal or of a log, and how it may end early."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from winding_cli.commands.refusal import FAILED, complain, fail, refuse
from winding_cli.commands.run_checks import check_before_start
from winding_cli.commands.termination import end
from winding_cli.output.progress_lines import ProgressLines, print_sentence
from winding_core.condition import Condition

if TYPE_CHECKING:
    from winding_recorder.live.recorder import RunBuffer
    from winding_supervisor.run import RunResult
    from winding_supervisor.run_config import RunConfig

_FIRST_WORDS = "starting the nodes; the first start after an install compiles kernels for a minute"


def wind(
    config: RunConfig, condition: Condition
) -> tuple[Path, RunResult, Callable[[], NoReturn] | None]:
    """Wind with a live picture on a terminal, and with lines of progress elsewhere.

    Returns:
        The run's folder, what it leaves, and how the command is to end if it ended early.
    """
    from rich.console import Console
    from rich.live import Live
    from rich.text import Text

    from winding_cli.output.early_import import import_early
    from winding_cli.output.live_view import LiveView
    from winding_recorder.live.recorder import RecorderError
    from winding_ros.graph_error import GraphError
    from winding_supervisor.domain_lock import DomainError
    from winding_supervisor.run import opened_run
    from winding_supervisor.run_config import RunFolderError

    check_before_start(config)
    console = Console(stderr=True)
    try:
        with opened_run(config) as run:
            directory = run.config.directory
            import_early("winding_study.reports.report")
            try:
                if not console.is_terminal:
                    return (
                        directory,
                        run.wind(ProgressLines(config.duration, _FIRST_WORDS), print_sentence),
                        None,
                    )
                with Live(Text(_FIRST_WORDS), console=console, transient=True) as live:

                    def view(buffer: RunBuffer, wall: float) -> None:
                        picture = LiveView(condition.resolved().case, config.duration, buffer)
                        live.update(picture.render(wall))

                    return directory, run.wind(view, live.console.print), None
            except (GraphError, TimeoutError, OSError) as error:
                reason = str(error)
                complain(reason)
                ending = fail
            except KeyboardInterrupt:
                reason = "interrupted"
                ending = partial(end, "interrupted; the nodes are stopped")
            remains = run.remains(reason)
            if remains is None:
                ending()
            return directory, remains, ending
    except (DomainError, RecorderError, RunFolderError) as error:
        refuse(error)
    except OSError as error:
        refuse(error, FAILED)
