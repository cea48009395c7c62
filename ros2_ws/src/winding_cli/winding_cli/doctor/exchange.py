"""Two processes with a ROS context each that pass messages there and back, as the graph's do."""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from winding_cli.doctor.finding import Finding, fail, ok, warn
from winding_cli.doctor.variables import RMW
from winding_core.units import MILLISECOND

_PROBE = "winding_cli.doctor.exchange_probe"
# On an idle machine two processes find each other in half a second.
_PATIENCE = 60.0
_START_PATIENCE, _END_PATIENCE = 60.0, 10.0
_SLOW = 0.05


@dataclass(frozen=True, kw_only=True)
class Exchange:
    """What came of it.

    Attributes:
        middleware: Identifier of the middleware in use; empty when none was.
        round_trips: Time from sending to the answer [s].
        strangers: Full names of other nodes in the domain.
        refusal: Why there was no answer; empty when there was.
    """

    middleware: str = ""
    round_trips: tuple[float, ...] = ()
    strangers: tuple[str, ...] = ()
    refusal: str = ""


def exchange(
    environment: Mapping[str, str], domain: int, logs: Path, patience: float = _PATIENCE
) -> Exchange:
    """Pass messages between two processes that join a domain as the graph's do.

    Args:
        environment: The user's.
        domain: DDS domain.
        logs: Folder of what ROS writes.
        patience: How long they may look for each other [s].
    """
    key = f"k{uuid.uuid4().hex[:12]}"
    command = [sys.executable, "-m", _PROBE, str(domain), str(logs), key, str(patience)]
    quiet = subprocess.DEVNULL
    with subprocess.Popen(
        [*command, "answer"], env=dict(environment), stdout=quiet, stderr=quiet
    ) as answering:
        try:
            asked = subprocess.run(
                [*command, "ask"],
                env=dict(environment),
                capture_output=True,
                text=True,
                timeout=patience + _START_PATIENCE,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return Exchange(refusal=f"a ROS process hung for {patience + _START_PATIENCE:g} s")
        finally:
            answering.terminate()
            try:
                answering.wait(_END_PATIENCE)
            except subprocess.TimeoutExpired:
                answering.kill()
    for line in asked.stdout.splitlines():
        # Fast DDS prints its errors there too.
        if line.startswith("{"):
            return Exchange(**json.loads(line))
    errors = [line.strip() for line in asked.stderr.splitlines() if line.strip()]
    return Exchange(refusal=errors[-1] if errors else f"it ended with exit code {asked.returncode}")


def judge_exchange(result: Exchange) -> list[Finding]:
    """Return which middleware there is, and how it passes messages."""
    return [_middleware(result), _round_trip(result)]


def _middleware(result: Exchange) -> Finding:
    if not result.middleware:
        return fail(
            "middleware",
            f"none starts: {result.refusal}",
            "unset RMW_IMPLEMENTATION; pip install 'cable-winding-twin[ros]'",
        )
    if result.middleware == RMW:
        return ok("middleware", RMW)
    found = f"{result.middleware}; the graph is tested with {RMW} only"
    return warn("middleware", found, "unset RMW_IMPLEMENTATION")


def _round_trip(result: Exchange) -> Finding:
    check = "message exchange"
    if result.refusal or not result.round_trips:
        return fail(
            check,
            result.refusal or "no message came back",
            "see RMW_IMPLEMENTATION, ROS_AUTOMATIC_DISCOVERY_RANGE and the loopback above",
        )
    middle = statistics.median(result.round_trips)
    found = (
        f"{len(result.round_trips)} round trips between two processes, "
        f"{middle / MILLISECOND:.2f} ms in the middle, "
        f"{max(result.round_trips) / MILLISECOND:.2f} ms at most"
    )
    if middle <= _SLOW:
        return ok(check, found)
    return warn(check, found, "end other programs; runs in real time need answers in 50 ms")
