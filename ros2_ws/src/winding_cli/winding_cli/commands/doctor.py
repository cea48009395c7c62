"""`winding doctor`: check a machine before the graph runs on it, and name remedies."""

from __future__ import annotations

import os
import tempfile
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import typer
from rich.markup import escape

from winding_cli.terminal.console import Shown, busy, record_table, result_console
from winding_cli.terminal.output_path import Force, Json, check_output_file, write_json
from winding_cli.terminal.record_options import Domain
from winding_cli.terminal.refusal import FAILED, refuse
from winding_cli.terminal.termination import interruptible

if TYPE_CHECKING:
    from winding_cli.doctor.finding import Finding

# The graph's default. Nothing here imports ROS: it may be what is wrong, and a middleware that
# is not there ends the process that imports it.
NAMESPACE = "winding"

_COLOURS = {"OK": "green", "WARN": "yellow", "FAIL": "bold red"}


def _level(finding: Finding) -> str:
    return f"[{_COLOURS[finding.level]}]{finding.level}[/]"


_COLUMNS = (
    Shown("check", lambda finding: escape(finding.check)),
    Shown("", _level),
    Shown("found", lambda finding: escape(finding.found)),
    Shown("what to do", lambda finding: escape(finding.advice)),
)


def doctor(json: Json = None, domain: Domain = None, force: Force = False) -> None:
    """Check Python, wheels, discovery, domain, clocks, disk; exit 1 on a FAIL."""
    from winding_cli.doctor.examination import examine
    from winding_supervisor.session.domain_lock import DomainError, chosen_domain, lock_folder

    source = "ROS_DOMAIN_ID" if os.environ.get("ROS_DOMAIN_ID") else "ROS_DOMAIN_ID is not set"
    check_output_file(json, "--json", force=force)
    refusal = ""
    try:
        chosen = chosen_domain(domain)
    except DomainError as error:
        if domain is not None:
            refuse(error)
        # A wrong variable is a finding; the other checks go on.
        chosen, refusal = 0, str(error)
    console = result_console()
    with (
        interruptible(),
        tempfile.TemporaryDirectory(prefix="winding-doctor-") as logs,
        busy("looking at this machine"),
    ):
        findings = list(
            examine(
                dict(os.environ),
                chosen,
                source if domain is None else "--domain",
                domain_refusal=refusal,
                namespace=NAMESPACE,
                folder=Path.cwd(),
                logs=Path(logs),
                locks=lock_folder(),
            )
        )
    found = Counter(str(finding.level) for finding in findings)
    counts = {level: found[level] for level in ("OK", "WARN", "FAIL")}
    console.print(record_table(_COLUMNS, findings, words=len(_COLUMNS)))
    console.print(f"{len(findings)} checks, {counts['FAIL']} failed, {counts['WARN']} warnings")
    checks = [asdict(finding) for finding in findings]
    write_json(json, {"domain": chosen, "counts": counts, "checks": checks})
    if counts["FAIL"]:
        raise typer.Exit(FAILED)
