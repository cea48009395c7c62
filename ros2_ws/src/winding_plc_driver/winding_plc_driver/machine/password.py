"""Where the mapping says that a user's password is: it is never in the mapping itself."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from winding_plc_driver.machine.mapping import MappingError, Server


def read_password(server: Server, environment: Mapping[str, str]) -> str:
    """Return the user's password; empty where there is no user.

    Raises:
        MappingError: It is nowhere to be found.
    """
    if not server.user:
        return ""
    if server.password_variable:
        if server.password_variable not in environment:
            raise MappingError(
                f"the password of user {server.user} is to be in the environment variable "
                f"{server.password_variable}, which is not set"
            )
        return environment[server.password_variable]
    try:
        lines = Path(server.password_file).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeError) as error:
        raise MappingError(f"the password file cannot be read: {error}") from None
    return lines[0] if lines else ""
