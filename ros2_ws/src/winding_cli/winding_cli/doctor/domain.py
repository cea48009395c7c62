"""The DDS domain: its number, its ports, and who is in it already."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

from winding_cli.doctor.finding import Finding, fail, ok, warn
from winding_cli.doctor.locks import is_held

DOMAIN_CHECK = "domain"
# RTPS 2.2, section 9.6.1.1: a domain has 250 ports, and a participant two of them.
_PORT_BASE, _DOMAIN_GAIN, _PARTICIPANT_GAIN, _UNICAST = 7400, 250, 2, 10
# Processes on one host that the graph's profile looks for.
PARTICIPANTS = 32
# Four nodes, the orchestrator and the operator's page.
_WANTED = 6


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
        return ok(DOMAIN_CHECK, found)
    return warn(
        DOMAIN_CHECK,
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


def judge_strangers(nodes: Collection[str]) -> Finding:
    """Return what other nodes in the domain mean for a run.

    Args:
        nodes: Full names of the nodes that are none of the doctor's.
    """
    check = "other nodes in the domain"
    if not nodes:
        return ok(check, "none")
    named = sorted(nodes)
    listed = ", ".join(named[:5]) + (f" and {len(named) - 5} more" if len(named) > 5 else "")
    return warn(
        check, listed, "a second publisher on a topic ends a run; choose another with --domain"
    )


def holders(folder: Path, domain: int) -> list[str]:
    """Return the namespaces of the graphs that hold a domain's locks in a folder."""
    prefix, suffix = f"domain-{domain}-", ".lock"
    return [
        lock.name.removeprefix(prefix).removesuffix(suffix)
        for lock in folder.glob(f"{prefix}*{suffix}")
        if is_held(lock)
    ]


def ephemeral_range(text: str) -> tuple[int, int]:
    """Return first and last port of /proc/sys/net/ipv4/ip_local_port_range.

    Raises:
        ValueError: It is not two numbers.
    """
    first, last = map(int, text.split())
    return first, last


def source_of(asked: int | None, environment: Mapping[str, str]) -> str:
    """Return where the number of the domain comes from."""
    if asked is not None:
        return "--domain"
    return "ROS_DOMAIN_ID" if environment.get("ROS_DOMAIN_ID") else "ROS_DOMAIN_ID is not set"
