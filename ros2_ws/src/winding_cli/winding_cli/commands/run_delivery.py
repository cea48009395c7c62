"""Every run of a command delivered: numbers, report, table; an operator winds as many as wanted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from winding_cli.commands.page_options import operated_condition
from winding_cli.commands.refusal import FAILED, complain, refuse
from winding_cli.commands.run_results import deliver, flaw, seed_of, show, write_trace
from winding_core.condition import Condition
from winding_core.operator_limits import OperatorLimits
from winding_core.parameters import Value

if TYPE_CHECKING:
    from winding_reports.records.identity import Origin
    from winding_supervisor.run_config import RunConfig
    from winding_supervisor.run_result import RunResult

_RIG = "winding_rig"


@dataclass(frozen=True, kw_only=True)
class DeliveryOptions:
    """Where what a run leaves goes, and what it is held against.

    Attributes:
        report: Folder of the report; None for `report` in the run's folder.
        json: File of the numbers; None for `run.json` in the run's folder.
        trace: File of the trace, or None.
        wish: Parameters of the wanted lay, if there is one.
        limits: Of that lay and of the corrected lengths, where no operator sets others.
        lay_held: Whether the user gave the lay's.
        errors_held: Whether the user gave the lengths'.
    """

    report: Path | None
    json: Path | None
    trace: Path | None
    wish: Mapping[str, Value]
    limits: OperatorLimits
    lay_held: bool
    errors_held: bool


class RunDelivery:
    """Delivers the runs of one command.

    Args:
        config: Of the command.
        condition: Of the command line.
        origin: Of the first run.
        into: Where everything goes.
    """

    def __init__(
        self, config: RunConfig, condition: Condition, origin: Origin, into: DeliveryOptions
    ) -> None:
        self._config, self._condition, self._into = config, condition, into
        self._origin: Origin | None = origin
        self._operated = config.page is not None
        self._directory = config.directory
        self._count = 0
        self._flaws: list[str] = []

    def begin(self, directory: Path) -> None:
        """Take the folder that was made for the command."""
        self._directory = directory

    def deliver(self, result: RunResult) -> None:
        """Write and print what a run leaves.

        A disk that takes no more ends no session: the operator winds on, and the command fails at
        its end.
        """
        if not self._operated:
            self._deliver(self._condition, result)
            return
        # The condition of a machine with a driver of its own is the command line's in every run.
        simulated = self._config.machine is None
        condition = operated_condition(self._condition, result) if simulated else self._condition
        if condition is None:
            return
        try:
            self._deliver(condition, result)
        except OSError as error:
            complain(f"the report of run {self._count} could not be written: {error}")
            self._flaws.append(str(error))

    def end(self) -> None:
        """End the command as its runs came out."""
        if self._operated and not self._count:
            print("the operator ended the run before anything was wound", flush=True)
        if self._flaws:
            refuse(self._flaws[-1], FAILED)

    def _deliver(self, condition: Condition, result: RunResult) -> None:
        into = self._into
        self._count += 1
        parameters = self._config.parameters()
        if result.wound:
            parameters[_RIG] |= result.wound
        limits = result.limits or into.limits
        folder = self._folder()
        numbers = self._numbered(into.json) or folder / "run.json"
        record, page = deliver(
            condition,
            result,
            self._numbered(into.report) or folder / "report",
            numbers,
            into.wish,
            limits.lay_tolerance,
            origin=self._own_origin(),
            seed=seed_of(parameters),
            error_limit_pct=limits.error_limit_pct,
        )
        trace = self._numbered(into.trace)
        if trace is not None:
            write_trace(record, result, trace)
        show(record, page, numbers, result.bags, trace)
        found = flaw(record, result, held=into.lay_held, errors_held=into.errors_held)
        if found:
            self._flaws.append(found)

    def _own_origin(self) -> Origin:
        from winding_cli.output.origin import origin_here

        origin, self._origin = self._origin, None
        return origin or origin_here()

    def _folder(self) -> Path:
        """Return the folder of the present run: the first has the command's own."""
        first = self._count == 1
        return self._directory if first else self._directory / f"run-{self._count}"

    def _numbered(self, path: Path | None) -> Path | None:
        """Return where the first run's file would be, or that of the present run beside it."""
        if path is None or self._count == 1:
            return path
        return path.with_name(f"{path.stem}-{self._count}{path.suffix}")
