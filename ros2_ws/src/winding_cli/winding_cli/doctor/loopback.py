"""Datagrams on this host: the way by which processes find each other."""

from __future__ import annotations

import socket
from collections.abc import Callable

from winding_cli.doctor.finding import Finding, fail, ok, warn

LOCALHOST = "127.0.0.1"
# The group on which DDS announces participants.
GROUP = "239.255.0.1"
_PATIENCE = 5.0
_PAYLOAD = b"winding doctor"


def send_unicast(patience: float = _PATIENCE) -> str:
    """Send a datagram from one socket to another; return why it did not arrive, or nothing."""
    return _refusal(lambda receiver: (LOCALHOST, receiver.getsockname()[1]), patience)


def send_multicast(patience: float = _PATIENCE) -> str:
    """Send a datagram to a group on the loopback; return why it did not arrive, or nothing."""

    def join(receiver: socket.socket) -> tuple[str, int]:
        membership = socket.inet_aton(GROUP) + socket.inet_aton(LOCALHOST)
        receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        return GROUP, receiver.getsockname()[1]

    return _refusal(join, patience, address="")


def judge_loopback(unicast: str, multicast: str) -> list[Finding]:
    """Return what the two datagrams say; an empty text stands for one that arrived."""
    if unicast:
        bring_up = "ip link set lo up; let the firewall pass 127.0.0.1"
        first = fail("datagrams on the loopback", unicast, bring_up)
    else:
        first = ok("datagrams on the loopback", f"arrive at {LOCALHOST}")
    if not multicast:
        return [first, ok("multicast on the loopback", f"arrives in {GROUP}")]
    return [
        first,
        warn(
            "multicast on the loopback",
            f"{multicast}; the graph does without, other tools may not find it",
            "ip link set lo multicast on; ip route add 224.0.0.0/4 dev lo",
        ),
    ]


def _refusal(
    destination: Callable[[socket.socket], tuple[str, int]],
    patience: float,
    address: str = LOCALHOST,
) -> str:
    try:
        with (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
        ):
            receiver.bind((address, 0))
            receiver.settimeout(patience)
            sender.setsockopt(
                socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(LOCALHOST)
            )
            sender.sendto(_PAYLOAD, destination(receiver))
            while receiver.recv(64) != _PAYLOAD:
                continue
    except TimeoutError:
        return f"nothing arrived in {patience:g} s"
    except OSError as error:
        return error.strerror or str(error)
    return ""
