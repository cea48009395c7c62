"""`winding faults`: put every fault of the table into real runs and judge how they came out."""

from __future__ import annotations

from contextlib import AsyncExitStack
from pathlib import Path
from typing import Annotated

import typer

from winding_cli.terminal.output_path import Force, Json, check_output_file, write_json
from winding_cli.terminal.refusal import FAILED, refuse
from winding_cli.terminal.ros_environment import joined

_DRIVER = Path("examples/driver_node.py")


def faults(
    json: Json = None,
    only: Annotated[
        str | None, typer.Option(help="Try only the runs whose name contains this text.")
    ] = None,
    random: Annotated[
        int | None, typer.Option(min=1, help="Try so many runs with drawn faults instead.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Of what is drawn.")] = 1,
    driver: Annotated[
        Path, typer.Option(help="Driver of a foreign machine, such as that of the examples.")
    ] = _DRIVER,
    domain: Annotated[
        int | None, typer.Option(help="DDS domain; else ROS_DOMAIN_ID, else 0.")
    ] = None,
    force: Force = False,
) -> None:
    """Kill, hold and mislead runs in every way of the table; exit 1 if one comes out wrong.

    An observer in a process of its own watches the machine; what the run leaves has to agree.
    """
    from winding_supervisor.session.interruption import Interruption, run_closing
    from winding_verification.faults import campaign
    from winding_verification.faults.campaign import draw_plans

    check_output_file(json, "--json", force=force)
    tried = campaign.ROWS
    if random is not None:
        tried = tuple(campaign.Row(plan=plan) for plan in draw_plans(random, seed))
    rows = [row for row in tried if (only or "") in row.plan.name]
    if not rows:
        refuse(f"no row of the fault table contains {only!r}")
    if any(row.plan.foreign for row in rows) and not driver.is_file():
        refuse(f"--driver: there is no file {driver}")

    async def work(_stack: AsyncExitStack, _interruption: Interruption) -> list[campaign.Outcome]:
        def report(outcome: campaign.Outcome) -> None:
            typer.echo(outcome.line, err=True)

        return await campaign.try_rows(rows, place.folder, driver.absolute(), report)

    with joined(domain) as place:
        outcomes = run_closing(work)
    passed = sum(outcome.passed for outcome in outcomes)
    typer.echo(f"{passed} of {len(outcomes)} runs came out as they had to")
    write_json(json, [outcome.as_record() for outcome in outcomes])
    if passed < len(outcomes):
        raise typer.Exit(FAILED)
