"""The DDS domain: number, ports, other graphs and nodes, datagrams, and an exchange of messages.

As a program it is one of the two processes of the exchange: `answer` sends back what `ask` sends.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import socket
import statistics
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from winding_cli.doctor.finding import Finding, fail, judged, ok, warn
from winding_cli.doctor.installation import RMW
from winding_core.units import MILLISECOND

if TYPE_CHECKING:
    from rclpy.node import Node

# RTPS 2.2, section 9.6.1.1: a domain has 250 ports, and a participant two of them.
_PORT_BASE, _DOMAIN_GAIN, _PARTICIPANT_GAIN, _UNICAST = 7400, 250, 2, 10
PARTICIPANTS = 32  # Processes on one host that the graph's profile looks for
# Four nodes, the orchestrator and the operator's page.
_WANTED = 6
_LOCALHOST = "127.0.0.1"
# The group on which DDS announces participants.
_GROUP = "239.255.0.1"
_LOOPBACK_PATIENCE = 5.0
_PAYLOAD = b"winding doctor"
_PROBE = "winding_cli.doctor.network"
# On an idle machine two processes find each other in half a second.
_PATIENCE = 60.0
_START_PATIENCE, _END_PATIENCE = 60.0, 10.0
_SLOW = 0.05
_COUNT = 20
_RESEND = 0.5
# The names of another process' nodes are asked for again at its heartbeat, every 3 s by default.
_ACQUAINTANCE = 4.0


def participant_ports(domain: int) -> list[int]:
    """Return the ports at which a domain's participants are found on this host."""
    first = _PORT_BASE + _DOMAIN_GAIN * domain + _UNICAST
    return [first + _PARTICIPANT_GAIN * k for k in range(PARTICIPANTS)]


def judge_domain(domain: int, source: str, ephemeral: tuple[int, int]) -> Finding:
    """Return whether a domain's ports stay clear of those that the system hands out.

    Args:
        domain: Its number.
        source: Where the number comes from.
        ephemeral: First and last port that the system gives to any program.
    """
    last = participant_ports(domain)[-1] + 1
    first = _PORT_BASE + _DOMAIN_GAIN * domain
    found = f"{domain} ({source}), ports {first} to {last}"
    if last < ephemeral[0] or first > ephemeral[1]:
        return ok("domain", found)
    return warn(
        "domain",
        f"{found}; the system hands out {ephemeral[0]} to {ephemeral[1]} and may take one of them",
        "choose another; with the usual range, one of 0 to 101",
    )


def judge_ports(domain: int, taken: Collection[int]) -> Finding:
    """Return whether a domain has room for the graph's processes.

    Args:
        domain: Its number.
        taken: UDP ports of this host that are in use.
    """
    ports = participant_ports(domain)
    used = [port for port in ports if port in taken]
    free = len(ports) - len(used)
    found = f"{free} of {len(ports)} places for participants are free"
    if free < _WANTED:
        return fail("participant ports", found, "choose another domain with --domain")
    if used:
        named = ", ".join(map(str, used[:4])) + (", ..." if len(used) > 4 else "")
        return warn(
            "participant ports",
            f"{found}; in use: UDP {named}",
            "something is in this domain already, or holds its ports; choose another with --domain",
        )
    return ok("participant ports", found)


def judge_owners(domain: int, namespace: str, holders: Collection[str]) -> Finding:
    """Return whether another graph of this machine owns the domain.

    Args:
        domain: Its number.
        namespace: Namespace of the run to come.
        holders: Namespaces of the graphs that run in the domain now.
    """
    check = "graphs in the domain"
    if namespace in holders:
        return fail(
            check,
            f"a graph in namespace /{namespace} runs in domain {domain}; a second one is refused",
            "wait for its end, or choose another with --domain or --namespace",
        )
    if holders:
        named = ", ".join(f"/{name}" for name in sorted(holders))
        return warn(check, f"{named} runs in domain {domain}", "choose another with --domain")
    return ok(check, "none")


def holders(folder: Path, domain: int) -> list[str]:
    """Return the namespaces of the graphs that hold a domain's locks in a folder."""
    prefix, suffix = f"domain-{domain}-", ".lock"
    return [
        lock.name.removeprefix(prefix).removesuffix(suffix)
        for lock in folder.glob(f"{prefix}*{suffix}")
        if _is_held(lock)
    ]


def _is_held(path: Path) -> bool:
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def judge_others(nodes: Collection[str]) -> Finding:
    """Return what other nodes in the domain, by their full names, mean for a run."""
    check = "other nodes in the domain"
    if not nodes:
        return ok(check, "none")
    named = sorted(nodes)
    listed = ", ".join(named[:5]) + (f" and {len(named) - 5} more" if len(named) > 5 else "")
    return warn(
        check, listed, "a second publisher on a topic ends a run; choose another with --domain"
    )


def judge_loopback(patience: float = _LOOPBACK_PATIENCE) -> list[Finding]:
    """Send a datagram and a multicast over the loopback; return whether they arrived in time."""
    unicast, multicast = "datagrams on the loopback", "multicast on the loopback"
    findings = [ok(unicast, f"arrive at {_LOCALHOST}"), ok(multicast, f"arrives in {_GROUP}")]
    if refusal := _refusal("", patience):
        bring_up = "ip link set lo up; let the firewall pass 127.0.0.1"
        findings[0] = fail(unicast, refusal, bring_up)
    if refusal := _refusal(_GROUP, patience):
        findings[1] = warn(
            multicast,
            f"{refusal}; the graph does without, other tools may not find it",
            "ip link set lo multicast on; ip route add 224.0.0.0/4 dev lo",
        )
    return findings


def _refusal(group: str, patience: float) -> str:
    """Return why a datagram from one socket to another did not arrive, or nothing."""
    local = socket.inet_aton(_LOCALHOST)
    try:
        with (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
        ):
            receiver.bind(("" if group else _LOCALHOST, 0))
            receiver.settimeout(patience)
            if group:
                membership = socket.inet_aton(group) + local
                receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
            sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, local)
            sender.sendto(_PAYLOAD, (group or _LOCALHOST, receiver.getsockname()[1]))
            while receiver.recv(64) != _PAYLOAD:
                continue
    except TimeoutError:
        return f"nothing arrived in {patience:g} s"
    except OSError as error:
        return error.strerror or str(error)
    return ""


@dataclass(frozen=True, kw_only=True)
class Exchange:
    """What came of an exchange of messages between two processes."""

    middleware: str = ""  # Identifier of the middleware in use; empty when none was
    round_trips: tuple[float, ...] = ()  # Time from sending to the answer [s]
    others: tuple[str, ...] = ()  # Full names of other nodes in the domain
    refusal: str = ""  # Why there was no answer; empty when there was


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
    advice = "end other programs; runs in real time need answers in 50 ms"
    return judged(check, found, advice, fine=middle <= _SLOW)


def _spin_until(node: Node, reached: Callable[[], bool], end: float) -> bool:
    """Spin until something holds, or to a monotonic time [s]; return whether it holds."""
    import rclpy

    while not reached():
        if time.monotonic() > end:
            return False
        rclpy.spin_once(node, timeout_sec=0.05)
    return True


def _answer(node: Node, key: str, patience: float) -> None:
    from rclpy.executors import ExternalShutdownException
    from std_msgs.msg import Header

    publisher = node.create_publisher(Header, f"doctor/{key}/answer", _COUNT)
    node.create_subscription(Header, f"doctor/{key}/ask", publisher.publish, _COUNT)
    with contextlib.suppress(ExternalShutdownException):
        _spin_until(node, lambda: False, time.monotonic() + patience)


def _ask(node: Node, key: str, patience: float) -> dict[str, object]:
    from std_msgs.msg import Header

    begin = time.monotonic()
    end = begin + patience
    answers: list[str] = []
    publisher = node.create_publisher(Header, f"doctor/{key}/ask", _COUNT)
    subscription = node.create_subscription(
        Header, f"doctor/{key}/answer", lambda message: answers.append(message.frame_id), _COUNT
    )
    times: list[float] = []
    refusal = ""
    if _spin_until(
        node,
        lambda: (
            publisher.get_subscription_count() > 0
            and node.count_publishers(subscription.topic_name) > 0
        ),
        end,
    ):
        while len(times) < _COUNT and time.monotonic() < end:
            # What is sent before the other side has matched is lost, and sent again.
            number, sent = str(len(times)), time.monotonic()
            publisher.publish(Header(frame_id=number))
            if _spin_until(node, lambda: number in answers, min(sent + _RESEND, end)):  # noqa: B023
                times.append(time.monotonic() - sent)
        if len(times) < _COUNT:
            refusal = f"no answer in {patience:g} s"
        else:
            _spin_until(node, lambda: False, begin + _ACQUAINTANCE)
    else:
        refusal = f"two processes do not find each other in {patience:g} s"
    names = {
        f"{namespace.rstrip('/')}/{name}"
        for name, namespace in node.get_node_names_and_namespaces()
        if not name.startswith("doctor_")
    }
    return {"round_trips": times, "others": sorted(names), "refusal": refusal}


def _main(domain: str, logs: str, key: str, patience: str, role: str) -> None:
    import rclpy
    from rclpy.node import Node
    from rclpy.utilities import get_rmw_implementation_identifier

    from winding_ros.environment import set_process_environment
    from winding_ros.runtime.process import SUPERVISED, end_with_supervisor

    set_process_environment(int(domain), Path(logs))
    os.environ[SUPERVISED] = str(os.getppid())
    middleware = get_rmw_implementation_identifier()
    rclpy.init()
    node = Node(f"doctor_{role}_{key}", enable_rosout=False, start_parameter_services=False)
    end_with_supervisor()
    record = {}
    if role == "answer":
        _answer(node, key, float(patience))
    else:
        record = {"middleware": middleware, **_ask(node, key, float(patience))}
    if rclpy.ok():
        node.destroy_node()
    rclpy.try_shutdown()
    if record:
        print(json.dumps(record), flush=True)


if __name__ == "__main__":
    _main(*sys.argv[1:])
