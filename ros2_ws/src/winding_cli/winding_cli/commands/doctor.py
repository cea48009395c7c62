"""`winding doctor`: check a machine before the graph runs on it, and say what to do."""

from __future__ import annotations

import json as json_format
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from winding_cli.commands.console import result_console
from winding_cli.commands.refusal import FAILED, refuse

if TYPE_CHECKING:
    from rich.console import Console

    from winding_cli.doctor.finding import Finding

# The graph's default. Nothing here imports ROS: it may be what is wrong, and a middleware that
# is not there ends the process that imports it.
NAMESPACE = "winding"


def doctor(
    json: Annotated[Path | None, typer.Option(help="Also write the findings to this file.")] = None,
    domain: Annotated[
        int | None, typer.Option(help="DDS domain; else ROS_DOMAIN_ID, else 0.")
    ] = None,
) -> None:
    """Check Python, wheels, discovery, domain, clocks, disk; exit 1 on a FAIL."""
    from winding_cli.doctor.domain import source_of
    from winding_cli.doctor.examination import HostFacts, examine
    from winding_supervisor.domain_lock import DomainError, chosen_domain, lock_folder

    refusal = ""
    try:
        chosen = chosen_domain(domain)
    except DomainError as error:
        if domain is not None:
            refuse(error)
        # The environment is what is looked at: the rest of it too.
        chosen, refusal = 0, str(error)
    console = result_console()
    with tempfile.TemporaryDirectory(prefix="winding-doctor-") as folder:
        patient = HostFacts(
            environment=dict(os.environ),
            domain=chosen,
            source=source_of(domain, os.environ),
            domain_refusal=refusal,
            namespace=NAMESPACE,
            folder=Path.cwd(),
            logs=Path(folder),
            locks=lock_folder(),
        )
        with console.status("looking at this machine"):
            findings = list(examine(patient))
    _show(findings, console)
    counts = {name: _count(findings, name) for name in ("OK", "WARN", "FAIL")}
    if json is not None:
        record = {
            "domain": chosen,
            "counts": counts,
            "checks": [finding.as_record() for finding in findings],
        }
        json.write_text(json_format.dumps(record, indent=1) + "\n", encoding="utf-8")
    if counts["FAIL"]:
        raise typer.Exit(FAILED)


def _show(findings: list[Finding], console: Console) -> None:
    from rich.table import Table
    from rich.text import Text

    style = {"OK": "green", "WARN": "yellow", "FAIL": "bold red"}
    table = Table("check", "", "found", "what to do")
    for finding in findings:
        name = finding.level.value
        table.add_row(
            finding.check, Text(name, style[name]), Text(finding.found), Text(finding.advice)
        )
    console.print(table)
    failed, warned = _count(findings, "FAIL"), _count(findings, "WARN")
    console.print(f"{len(findings)} checks, {failed} failed, {warned} warnings")


def _count(findings: list[Finding], level: str) -> int:
    return sum(finding.level.value == level for finding in findings)
