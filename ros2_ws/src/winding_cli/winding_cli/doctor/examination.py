"""All checks of one machine, in the order in which they are told."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import psutil  # type: ignore[import-untyped]

from winding_cli.doctor import capacity, clock, disk, domain, loopback
from winding_cli.doctor.exchange import exchange, judge_exchange
from winding_cli.doctor.finding import Finding, fail, warn
from winding_cli.doctor.import_probe import import_all
from winding_cli.doctor.variables import judge_variables
from winding_cli.doctor.wheels import WHEELS, judge_python, judge_wheels

_CLOCK_LOOKS, _CLOCK_PERIOD = 20, 0.01
_PORT_RANGE = Path("/proc/sys/net/ipv4/ip_local_port_range")
_RECEIVE_BUFFER = Path("/proc/sys/net/core/rmem_max")
_DEFAULT_PORTS = (32_768, 60_999)


@dataclass(frozen=True, kw_only=True)
class HostFacts:
    """What is examined.

    Attributes:
        environment: As the user has it.
        domain: DDS domain.
        source: Where its number comes from.
        domain_refusal: Why ROS_DOMAIN_ID is not used; empty when it is.
        namespace: Namespace of the run to come.
        folder: Where recordings would go.
        logs: Folder for what ROS writes meanwhile.
        locks: Folder of the locks of running graphs.
    """

    environment: Mapping[str, str]
    domain: int
    source: str
    namespace: str
    folder: Path
    logs: Path
    locks: Path
    domain_refusal: str = ""


def examine(patient: HostFacts) -> Iterator[Finding]:
    """Yield every finding; what cannot be looked at is a warning, not an end."""
    yield judge_python(sys.version_info[:3])
    # A middleware that is not there ends every import of rclpy; that is a finding of its own.
    clean = {k: v for k, v in patient.environment.items() if k != "RMW_IMPLEMENTATION"}
    yield from judge_wheels(import_all(WHEELS, clean))
    yield from judge_variables(patient.environment, os.path.isfile)
    # Before the doctor's own processes take places in the domain.
    yield _domain(patient)
    yield from _looked(
        "participant ports", lambda: [domain.judge_ports(patient.domain, udp_ports())]
    )
    yield from _looked("graphs in the domain", lambda: [_owners(patient)])
    yield from loopback.judge_loopback(loopback.send_unicast(), loopback.send_multicast())
    result = exchange(patient.environment, patient.domain, patient.logs)
    yield from judge_exchange(result)
    yield domain.judge_strangers(result.strangers)
    yield from _clocks()
    yield from _disk(patient.folder)
    yield capacity.judge_processors(len(os.sched_getaffinity(0)), os.getloadavg()[0])
    yield capacity.judge_memory(psutil.virtual_memory().available)
    yield capacity.judge_open_files(_open_files())
    yield capacity.judge_receive_buffer(_number(_RECEIVE_BUFFER))


def udp_ports() -> Collection[int]:
    """Return the UDP ports of this host that are in use."""
    return {c.laddr.port for c in psutil.net_connections(kind="udp4") if c.laddr}


def newest_installed() -> float:
    """Return when the newest file beside the installed packages was written [s]."""
    places = {Path(psutil.__file__).parent.parent, Path(__file__).parent}
    return max(entry.stat().st_mtime for place in places for entry in os.scandir(place))


def _looked(check: str, look: Callable[[], list[Finding]]) -> list[Finding]:
    try:
        return look()
    except (OSError, psutil.Error) as error:
        return [warn(check, f"cannot tell: {error}", "look at it by hand")]


def _domain(patient: HostFacts) -> Finding:
    if patient.domain_refusal:
        return fail(domain.DOMAIN_CHECK, patient.domain_refusal, "unset ROS_DOMAIN_ID, or set it")
    return domain.judge_domain(patient.domain, patient.source, _ephemeral_ports())


def _owners(patient: HostFacts) -> Finding:
    return domain.judge_owners(
        patient.domain, patient.namespace, domain.holders(patient.locks, patient.domain)
    )


def _ephemeral_ports() -> tuple[int, int]:
    try:
        return domain.ephemeral_range(_PORT_RANGE.read_text(encoding="ascii"))
    except (OSError, ValueError):
        return _DEFAULT_PORTS


def _clocks() -> Iterator[Finding]:
    yield clock.judge_resolution(time.get_clock_info("monotonic").resolution)
    yield from _looked("time of day", lambda: [clock.judge_date(time.time(), newest_installed())])
    pairs = []
    for _ in range(_CLOCK_LOOKS):
        pairs.append(clock.read_clocks(time.monotonic, time.time))
        time.sleep(_CLOCK_PERIOD)
    yield clock.judge_jumps(pairs)
    yield clock.judge_synchronisation(_synchronised())


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


def _disk(folder: Path) -> list[Finding]:
    try:
        free = disk.free_space(folder)
        space = disk.judge_space(folder, free)
        return [space, disk.judge_speed(disk.write_speed(folder, time.monotonic))]
    except OSError as error:
        return disk.judge_no_disk(f"{folder}: {error.strerror or error}")


def _open_files() -> int:
    soft, _ = psutil.Process().rlimit(psutil.RLIMIT_NOFILE)
    return int(soft) if soft >= 0 else sys.maxsize


def _number(file: Path) -> int | None:
    try:
        return int(file.read_text(encoding="ascii"))
    except (OSError, ValueError):
        return None
