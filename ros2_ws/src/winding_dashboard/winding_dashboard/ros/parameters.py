"""Parameters of the operator's page."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass

from winding_core.machine.axes import MachineAxes
from winding_core.parameters import ParameterError, parameter
from winding_core.run_options import CameraPlacement, OperatorLimits

# Sixteen characters of a random token are more than anybody can try over a network.
MINIMUM_TOKEN = 16


@dataclass(frozen=True, kw_only=True)
class DashboardParameters(CameraPlacement, MachineAxes, OperatorLimits):
    """Where the page is served, where the camera stands, the machine's axes, and the limits."""

    host: str = parameter(
        "127.0.0.1", "address that the page is served on; others than loopback need a token"
    )
    port: int = parameter(8080, "TCP port of the page", low=1, high=65535)
    token: str = parameter("", "secret that a browser must bring; empty for none")

    runs: str = parameter(
        "", "folder whose runs are listed with verdict and report; empty for no list"
    )

    nodes: str = parameter(
        "",
        "names of the graph's nodes in the order of activation, with commas between; empty for "
        "those of a simulated machine",
    )

    @property
    def named_nodes(self) -> tuple[str, ...]:
        """The names in `nodes`."""
        return tuple(name.strip() for name in self.nodes.split(",") if name.strip())

    @property
    def loopback(self) -> bool:
        """Whether only this machine can reach the page."""
        return is_loopback(self.host)

    def check(self) -> None:
        """Refuse a page that anybody on the network could command.

        Raises:
            ParameterError: The host is no address, or it is not loopback and there is no token.
        """
        if not self.loopback and len(self.token) < MINIMUM_TOKEN:
            raise ParameterError(
                f"host {self.host} can be reached from other machines: parameter token needs at "
                f"least {MINIMUM_TOKEN} characters, got {len(self.token)}"
            )


def is_loopback(host: str) -> bool:
    """Return whether an address or `localhost` is reached from this machine alone.

    Raises:
        ParameterError: Neither an IP address nor `localhost`.
    """
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        raise ParameterError(f"host must be an IP address or localhost, got {host!r}") from None
