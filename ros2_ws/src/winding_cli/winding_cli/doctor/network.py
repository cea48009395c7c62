"""The DDS domain: its number, its ports, who is in it already, and the datagrams it needs."""

from __future__ import annotations

import fcntl
import socket
from collections.abc import Collection
from pathlib import Path

from winding_cli.doctor.finding import Finding, fail, ok, warn

# RTPS 2.2, section 9.6.1.1: a domain has 250 ports, and a participant two of them.
_PORT_BASE, _DOMAIN_GAIN, _PARTICIPANT_GAIN, _UNICAST = 7400, 250, 2, 10
# Processes on one host that the graph's profile looks for.
PARTICIPANTS = 32
# Four nodes, the orchestrator and the operator's page.
_WANTED = 6
_LOCALHOST = "127.0.0.1"
# The group on which DDS announces participants.
_GROUP = "239.255.0.1"
_PATIENCE = 5.0
_PAYLOAD = b"winding doctor"


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


def judge_strangers(nodes: Collection[str]) -> Finding:
    """Return what other nodes in the domain, by their full names, mean for a run."""
    check = "other nodes in the domain"
    if not nodes:
        return ok(check, "none")
    named = sorted(nodes)
    listed = ", ".join(named[:5]) + (f" and {len(named) - 5} more" if len(named) > 5 else "")
    return warn(
        check, listed, "a second publisher on a topic ends a run; choose another with --domain"
    )


def judge_loopback(patience: float = _PATIENCE) -> list[Finding]:
    """Send a datagram and a multicast over the loopback; return whether they arrived in time."""
    unicast, multicast = "datagrams on the loopback", "multicast on the loopback"
    findings = [
        ok(unicast, f"arrive at {_LOCALHOST}"),
        ok(multicast, f"arrives in {_GROUP}"),
    ]
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
