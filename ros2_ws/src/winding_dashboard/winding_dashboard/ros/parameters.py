"""Parameters of the operator's page, and its token, which is none: whoever joins reads those."""

import ipaddress
import os
import stat
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from winding_core.machine.axes import MachineAxes
from winding_core.parameters import ParameterError, parameter
from winding_core.run_options import CameraPlacement, OperatorLimits

# Sixteen characters of a random token are more than anybody can try over a network.
MINIMUM_TOKEN = 16
# The token itself, where there is no file of it. It is inherited and does not show in `ps`.
TOKEN_VARIABLE = "WINDING_DASHBOARD_TOKEN"
_LONGEST_TOKEN = 4096


@dataclass(frozen=True, kw_only=True)
class DashboardParameters(CameraPlacement, MachineAxes, OperatorLimits):
    """Where the page is served, where the camera stands, the machine's axes, and the limits."""

    host: str = parameter(
        "127.0.0.1", "address that the page is served on; others than loopback need a token"
    )
    port: int = parameter(8080, "TCP port of the page", low=1, high=65535)
    token_file: str = parameter(
        "",
        "file of the secret that a browser must bring, readable by its owner alone; empty for the "
        f"environment variable {TOKEN_VARIABLE}, or for none",
    )

    runs: str = parameter(
        "", "folder whose runs are listed with verdict and report; empty for no list"
    )

    machine_file: str = parameter(
        "", "file of the arm that carries the guide and is drawn; empty for a carriage"
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
        """Whether only this machine can reach the page.

        Raises:
            ParameterError: The host is neither an IP address nor `localhost`.
        """
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host.strip("[]")).is_loopback
        except ValueError:
            raise ParameterError(
                f"host must be an IP address or localhost, got {self.host!r}"
            ) from None

    def token(self, environment: Mapping[str, str] = os.environ) -> str:
        """Return the secret that a browser must bring; empty for none.

        Raises:
            ParameterError: The host is no address, or others reach it and the secret is too short,
                or others can read its file.
        """
        if self.token_file:
            secret = _read_secret(Path(self.token_file))
        else:
            secret = environment.get(TOKEN_VARIABLE, "")
        if (secret or not self.loopback) and len(secret) < MINIMUM_TOKEN:
            reach = (
                "" if self.loopback else f"host {self.host} can be reached from other machines: "
            )
            raise ParameterError(
                f"{reach}the token needs at least {MINIMUM_TOKEN} characters, got {len(secret)}; "
                f"it comes from token_file or {TOKEN_VARIABLE}"
            )
        return secret

    def check(self) -> None:
        """Refuse a page that anybody on the network could command; raise as `token` does."""
        self.token()


def _read_secret(path: Path) -> str:
    """Return the text of a file that is its user's alone.

    Raises:
        ParameterError: It is not, or it cannot be read.
    """
    try:
        # A pipe without a writer must not hold the page up.
        with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb") as file:
            found = os.fstat(file.fileno())
            if found.st_uid != os.geteuid() or found.st_mode & 0o077:
                raise ParameterError(
                    f"token_file {path} must be its user's alone: owner {os.geteuid()} and mode "
                    f"0600, got {found.st_uid} and {stat.S_IMODE(found.st_mode):04o}"
                )
            if not stat.S_ISREG(found.st_mode):
                raise ParameterError(f"token_file {path} is no file")
            return file.read(_LONGEST_TOKEN).decode("ascii").strip()
    except OSError as error:
        raise ParameterError(f"token_file {path} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError:
        raise ParameterError(f"token_file {path} must hold ASCII text") from None
