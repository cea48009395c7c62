"""Whom the driver says it is to a real OPC UA server: a name with a password, or a certificate."""

from pathlib import Path
from typing import Any

import pytest

from winding_core.status import Level

pytestmark = [pytest.mark.campaign, pytest.mark.processes, pytest.mark.slow]


@pytest.mark.asyncio
async def test_certificates_and_a_user_name_open_the_session(
    machine: Any, driver: Any, relay: Any, listener: Any, secured: Any
) -> None:
    security, options = await secured()
    plc = machine("--user", "winding", "--password", "right", *options)
    path = relay(plc.port)
    user = {"user": "winding", "password_variable": "PLC_PASSWORD"}
    driver(path.port, {"PLC_PASSWORD": "right"}, **security, **user)
    listener.more(100)
    path.cut()
    listener.wait_for(Level.ERROR, "has been lost for")
    path.restore()
    status = listener.wait_for(Level.OK, "the link is up")
    assert status.values["sessions resumed"] == "1"
    listener.more(100)


@pytest.mark.parametrize("encrypted", [False, True])
@pytest.mark.asyncio
async def test_a_wrong_password_is_one_sentence_before_anything_else(
    encrypted: bool, machine: Any, driver: Any, secured: Any, tmp_path: Path
) -> None:
    security, options = await secured() if encrypted else ({}, [])
    plc = machine("--user", "winding", "--password", "right", *options)
    (tmp_path / "password.txt").write_text("wrong\n", encoding="utf-8")
    process = driver(plc.port, user="winding", password_file="password.txt", **security)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == 2
    assert said.startswith(f"error: the connection to opc.tcp://127.0.0.1:{plc.port} was refused: ")
    assert "(BadUserAccessDenied)" in said
    assert said.count("\n") == 1
    assert "wrong" not in said


def users_by_certificate(known: Path) -> dict[str, str]:
    """Return the changes of the machine that knows one user, by certificate."""
    users = "Users(options.user, options.password)"
    return {
        "from asyncua.crypto.permission_rules": (
            "from asyncua.server.user_managers import CertificateUserManager\n"
            "from asyncua.crypto.permission_rules"
        ),
        f"    server = Server(user_manager={users})\n": (
            "    users = CertificateUserManager()\n"
            f"    await users.add_user(Path({str(known)!r}), name='winding')\n"
            "    server = Server(user_manager=users)\n"
        ),
    }


@pytest.mark.asyncio
async def test_a_user_s_certificate_opens_the_session_and_resumes_it(
    machine: Any, driver: Any, relay: Any, listener: Any, secured: Any, pair: Any, tmp_path: Path
) -> None:
    security, options = await secured()
    await pair("user", "urn:winding:user")
    plc = machine(*options, changes=users_by_certificate(tmp_path / "user.der"))
    path = relay(plc.port)
    user = {"user_certificate": "user.der", "user_private_key": "user.pem"}
    driver(path.port, **security, **user)
    listener.more(100)
    assert listener.call("start") == (True, "start: done")
    path.cut()
    listener.wait_for(Level.ERROR, "has been lost for")
    path.restore()
    status = listener.wait_for(Level.OK, "the link is up")
    assert status.values["sessions resumed"] == "1"
    listener.more(100)


@pytest.mark.parametrize(
    ("certificate", "key", "reason"),
    [
        # Whom the channel belongs to is no user here.
        ("", "", "BadUserAccessDenied"),
        ("other.der", "other.pem", "BadUserAccessDenied"),
        # What asyncua's server says of a signature by another key.
        ("user.der", "other.pem", "BadIdentityTokenInvalid"),
        ("user.der", "missing.pem", "missing.pem is not a file"),
    ],
    ids=["nobody", "a stranger", "somebody else's key", "no key"],
)
@pytest.mark.asyncio
async def test_who_is_not_that_user_is_refused_in_one_sentence(
    certificate: str,
    key: str,
    reason: str,
    machine: Any,
    driver: Any,
    secured: Any,
    pair: Any,
    tmp_path: Path,
) -> None:
    security, options = await secured()
    for name in ("user", "other"):
        await pair(name, f"urn:winding:{name}")
    plc = machine(*options, changes=users_by_certificate(tmp_path / "user.der"))
    user = {"user_certificate": certificate, "user_private_key": key}
    process = driver(plc.port, **security, **user)
    said = process.communicate(timeout=60)[1]
    assert process.returncode == 2
    assert said.startswith(f"error: the connection to opc.tcp://127.0.0.1:{plc.port} was refused: ")
    assert reason in said
    assert said.count("\n") == 1
