"""`winding doctor`: check a machine before the graph runs on it, and name remedies."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path

import psutil  # type: ignore[import-untyped]
import typer
from rich.markup import escape

from winding_cli.doctor import host, network
from winding_cli.doctor.finding import Finding, fail, warn
from winding_cli.doctor.installation import (
    WHEELS,
    import_all,
    installed,
    judge_addresses,
    judge_python,
    judge_variables,
    judge_wheels,
)
from winding_cli.terminal.console import Shown, busy, record_table, result_console
from winding_cli.terminal.output_path import Force, Json, check_output_file, write_json
from winding_cli.terminal.record_options import Domain
from winding_cli.terminal.refusal import FAILED, refuse
from winding_cli.terminal.termination import interruptible

_CLOCK_LOOKS, _CLOCK_PERIOD = 20, 0.01
_PORT_RANGE = Path("/proc/sys/net/ipv4/ip_local_port_range")
_RECEIVE_BUFFER = Path("/proc/sys/net/core/rmem_max")
_DEFAULT_PORTS = (32_768, 60_999)


def examine(domain: int, source: str, domain_refusal: str, logs: Path) -> Iterator[Finding]:
    """Yield every finding; what cannot be examined is a warning, not an end.

    Args:
        domain: DDS domain.
        source: Where its number comes from.
        domain_refusal: Why ROS_DOMAIN_ID is not used; empty when it is.
        logs: Folder for what ROS writes meanwhile.
    """
    from winding_supervisor.session.domain_lock import lock_folder

    environment = dict(os.environ)
    yield judge_python(sys.version_info[:3])
    # A middleware that is not there ends every import of rclpy; that is a finding of its own.
    clean = {k: v for k, v in environment.items() if k != "RMW_IMPLEMENTATION"}
    yield from judge_wheels(import_all(WHEELS, clean))
    yield from judge_variables(environment, os.path.isfile)
    # Before the doctor's own processes take places in the domain.
    if domain_refusal:
        yield fail("domain", domain_refusal, "unset ROS_DOMAIN_ID, or set it")
    else:
        first, last = _numbers(_PORT_RANGE, 2) or _DEFAULT_PORTS
        yield network.judge_domain(domain, source, (first, last))
    yield _looked("participant ports", lambda: network.judge_ports(domain, udp_ports()))
    yield _looked(
        "graphs in the domain",
        lambda: network.judge_owners(domain, NAMESPACE, network.holders(lock_folder(), domain)),
    )
    yield from network.judge_loopback()
    result = network.exchange(environment, domain, logs)
    yield from network.judge_exchange(result)
    yield network.judge_others(result.others)
    yield host.judge_resolution(time.get_clock_info("monotonic").resolution)
    yield _looked("time of day", lambda: host.judge_date(time.time(), newest_installed()))
    yield host.judge_jumps(_clock_pairs())
    yield host.judge_synchronisation(_synchronised())
    yield from host.judge_disk(Path.cwd(), time.monotonic)
    yield host.judge_processors(len(os.sched_getaffinity(0)), os.getloadavg()[0])
    yield host.judge_memory(psutil.virtual_memory().available)
    soft, _ = psutil.Process().rlimit(psutil.RLIMIT_NOFILE)
    yield host.judge_open_files(int(soft) if soft >= 0 else sys.maxsize)
    yield host.judge_receive_buffer(next(iter(_numbers(_RECEIVE_BUFFER, 1)), None))
    yield judge_addresses(installed())


def udp_ports() -> set[int]:
    """Return the UDP ports of this host that are in use."""
    return {c.laddr.port for c in psutil.net_connections(kind="udp4") if c.laddr}


def newest_installed() -> float:
    """Return when the newest file beside the installed packages was written [s]."""
    places = {Path(psutil.__file__).parent.parent, Path(__file__).parent}
    return max(entry.stat().st_mtime for place in places for entry in os.scandir(place))


def _looked(check: str, look: Callable[[], Finding]) -> Finding:
    try:
        return look()
    except (OSError, psutil.Error) as error:
        return warn(check, f"cannot tell: {error}", "look at it by hand")


def _numbers(path: Path, count: int) -> tuple[int, ...]:
    """Return the numbers that a file of the kernel holds; none where there are not so many."""
    try:
        found = tuple(map(int, path.read_text(encoding="ascii").split()))
    except (OSError, ValueError):
        return ()
    return found if len(found) == count else ()


def _clock_pairs() -> Iterator[host.ClockPair]:
    for _ in range(_CLOCK_LOOKS):
        yield host.read_clocks(time.monotonic, time.time)
        time.sleep(_CLOCK_PERIOD)


def _synchronised() -> str | None:
    try:
        asked = subprocess.run(
            ["timedatectl", "show", "--property=NTPSynchronized", "--value"],
            capture_output=True,
            text=True,
            timeout=10.0,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    answer = asked.stdout.strip()
    return answer if asked.returncode == 0 and answer in ("yes", "no") else None


# The graph's default. Nothing here imports ROS: it may be what is wrong, and a middleware that
# is not there ends the process that imports it.
NAMESPACE = "winding"

_COLOURS = {"OK": "green", "WARN": "yellow", "FAIL": "bold red"}

_COLUMNS = (
    Shown("check", lambda finding: escape(finding.check)),
    Shown("", lambda finding: f"[{_COLOURS[finding.level]}]{finding.level}[/]"),
    Shown("found", lambda finding: escape(finding.found)),
    Shown("what to do", lambda finding: escape(finding.advice)),
)


def doctor(json: Json = None, domain: Domain = None, force: Force = False) -> None:
    """Check Python, wheels, discovery, domain, clocks, disk; exit 1 on a FAIL."""
    from winding_supervisor.session.domain_lock import DomainError, chosen_domain

    source = "ROS_DOMAIN_ID" if os.environ.get("ROS_DOMAIN_ID") else "ROS_DOMAIN_ID is not set"
    source = source if domain is None else "--domain"
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
        findings = list(examine(chosen, source, refusal, Path(logs)))
    found = Counter(str(finding.level) for finding in findings)
    counts = {level: found[level] for level in ("OK", "WARN", "FAIL")}
    console.print(record_table(_COLUMNS, findings, words=len(_COLUMNS)))
    console.print(f"{len(findings)} checks, {counts['FAIL']} failed, {counts['WARN']} warnings")
    checks = [asdict(finding) for finding in findings]
    write_json(json, {"domain": chosen, "counts": counts, "checks": checks})
    if counts["FAIL"]:
        raise typer.Exit(FAILED)
