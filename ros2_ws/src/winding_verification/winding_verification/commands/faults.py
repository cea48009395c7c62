"""`winding faults`: put every fault of the table into real processes and measure what happens."""

from __future__ import annotations

import sys
from contextlib import AsyncExitStack
from typing import Annotated, Any

import typer

from winding_cli.terminal.console import result_console
from winding_cli.terminal.output_path import Force, Json, check_output_file, write_json
from winding_cli.terminal.refusal import FAILED, refuse, refused
from winding_cli.terminal.ros_environment import joined


def faults(
    json: Json = None,
    only: Annotated[
        str | None, typer.Option(help="Try only the rows whose name contains this text.")
    ] = None,
    domain: Annotated[
        int | None, typer.Option(help="DDS domain; else ROS_DOMAIN_ID, else 0.")
    ] = None,
    force: Force = False,
) -> None:
    """Kill, hold and mislead a running graph in every way of the table; exit 1 if it fails one."""
    from winding_supervisor.session.domain_lock import DomainError, domain_lock
    from winding_supervisor.session.interruption import Interruption, run_closing
    from winding_verification.faults import campaign

    check_output_file(json, "--json", force=force)
    names = {name for name in campaign.row_names() if (only or "") in name}
    if not names:
        refuse(f"no row of the fault table contains {only!r}")

    async def work(_stack: AsyncExitStack, _interruption: Interruption) -> list[Any]:
        outcomes: list[Any] = await campaign.try_rows(names, place.folder, _report)
        return outcomes

    with (
        refused(DomainError),
        joined(domain) as place,
        domain_lock(place.domain, campaign.NAMESPACE),
    ):
        outcomes = run_closing(work)
    campaign.show(outcomes, result_console())
    if json is not None:
        write_json(json, [outcome.as_record() for outcome in outcomes])
    if not all(outcome.passed for outcome in outcomes):
        raise typer.Exit(FAILED)


def _report(outcome: Any) -> None:
    word = "ok    " if outcome.passed else "FAILED"
    print(f"{word}  {outcome.fault}", file=sys.stderr, flush=True)
