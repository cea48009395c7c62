"""Who reaches the page, and who is refused before anything is served."""

import asyncio
import os
import re
import subprocess
from pathlib import Path
from typing import Any

import httpx
import pytest
from rcl_interfaces.srv import GetParameters, ListParameters

from processes import COMMAND, free_port
from winding_core.parameters import ParameterError
from winding_dashboard.ros.parameters import TOKEN_VARIABLE, DashboardParameters
from winding_dashboard.web.access import COOKIE, Gate

TOKEN = "correct-horse-battery"


async def behind(_scope: Any, _receive: Any, send: Any) -> None:
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b"the page"})


def get(url: str, *, token: str = "", host: str = "127.0.0.1", **headers: str) -> httpx.Response:
    async def ask() -> httpx.Response:
        transport = httpx.ASGITransport(Gate(behind, token=token, host=host))
        async with httpx.AsyncClient(transport=transport) as client:
            return await client.get(url, headers=headers)

    return asyncio.run(ask())


def test_this_machine_is_let_in() -> None:
    assert get("http://127.0.0.1:8080/").text == "the page"
    assert get("http://localhost:8080/").text == "the page"


def test_foreign_name_that_resolves_here_is_refused() -> None:
    assert get("http://evil.example:8080/").status_code == 403


def test_other_sites_cannot_ask_on_the_operators_behalf() -> None:
    assert get("http://127.0.0.1:8080/", origin="http://evil.example").status_code == 403
    assert get("http://127.0.0.1:8080/", origin="http://127.0.0.1:8080").status_code == 200


def test_web_sockets_of_other_sites_are_closed() -> None:
    sent: list[dict[str, Any]] = []

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    async def receive() -> dict[str, Any]:
        return {"type": "websocket.connect"}

    scope = {
        "type": "websocket",
        "path": "/",
        "headers": [(b"host", b"127.0.0.1:8080"), (b"origin", b"http://evil.example")],
    }
    asyncio.run(Gate(behind, token="", host="127.0.0.1")(scope, receive, send))
    assert [message["type"] for message in sent] == ["websocket.close"]


def test_token_is_asked_for_and_handed_over_once() -> None:
    url = "http://10.0.0.5:8080/"
    settings = {"token": TOKEN, "host": "10.0.0.5"}
    assert get(url, **settings).status_code == 401
    assert get(f"{url}?token=wrong", **settings).status_code == 401
    welcome = get(f"{url}?token={TOKEN}", **settings)
    assert (welcome.status_code, welcome.headers["location"]) == (303, "/")
    assert "HttpOnly" in welcome.headers["set-cookie"]
    assert get(url, cookie=f"{COOKIE}={TOKEN}", **settings).text == "the page"


def test_open_address_without_a_token_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.touch(0o600)
    file.write_text(f"{TOKEN}\n")
    for host in ("0.0.0.0", "192.168.1.4", "::"):
        with pytest.raises(ParameterError, match="token needs at least 16 characters, got 0"):
            DashboardParameters(host=host).token({})
        with pytest.raises(ParameterError, match="token needs at least 16 characters, got 5"):
            DashboardParameters(host=host).token({TOKEN_VARIABLE: "short"})
        assert DashboardParameters(host=host).token({TOKEN_VARIABLE: TOKEN}) == TOKEN
        assert DashboardParameters(host=host, token_file=str(file)).token({}) == TOKEN
    assert DashboardParameters().token({}) == ""


@pytest.mark.parametrize(
    ("mode", "owner", "content", "sentence"),
    [
        (0o640, 0, TOKEN, "must be its user's alone: owner 0 and mode 0600, got 0 and 0640"),
        (0o602, 0, TOKEN, "mode 0600, got 0 and 0602"),
        (0o600, 1234, TOKEN, "owner 0 and mode 0600, got 1234 and 0600"),
        (0o600, 0, "correct-hörse-battery", "must hold ASCII text"),
        (0o600, 0, "correct", "needs at least 16 characters, got 7; it comes from token_file"),
    ],
)
def test_a_token_that_others_may_know_is_refused(
    tmp_path: Path, mode: int, owner: int, content: str, sentence: str
) -> None:
    file = tmp_path / "token"
    file.write_text(content)
    file.chmod(mode)
    own = os.geteuid()
    if owner:
        if own != 0:
            pytest.skip("only root gives files to another user")
        os.chown(file, owner, owner)
    expected = sentence.replace("owner 0", f"owner {own}").replace("got 0 and", f"got {own} and")
    with pytest.raises(ParameterError, match=re.escape(expected)):
        DashboardParameters(token_file=str(file)).token({TOKEN_VARIABLE: "never-asked-for-this"})


def test_a_token_file_that_is_none_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe", 0o600)
    for name, sentence in (("pipe", "is no file"), ("", "is a directory"), ("gone", "No such")):
        with pytest.raises(ParameterError, match=f"(?i){sentence}"):
            DashboardParameters(token_file=str(tmp_path / name)).token({})


def status_of(url: str) -> int:
    try:
        return httpx.get(url).status_code
    except httpx.TransportError:
        return 0


@pytest.mark.processes
@pytest.mark.slow
def test_the_token_shows_neither_in_ps_nor_among_the_parameters(ros: Any, tmp_path: Path) -> None:
    file, port = tmp_path / "token", free_port()
    file.touch(0o600)
    file.write_text(TOKEN)
    words = ["dashboard", "--namespace", "kept", "--port", str(port), "--token-file", str(file)]
    page = subprocess.Popen([*COMMAND, *words])
    try:
        node = ros.plain("reader")
        listed = ros.call(node, ListParameters, "/kept/dashboard/list_parameters",
                          ListParameters.Request())  # fmt: skip
        asked = GetParameters.Request(names=[*listed.result.names])
        values = ros.call(node, GetParameters, "/kept/dashboard/get_parameters", asked).values
        known = dict(zip(asked.names, (value.string_value for value in values), strict=True))
        assert known["token_file"] == str(file)
        assert TOKEN not in str(known)
        url = f"http://127.0.0.1:{port}/"
        ros.spin_until(lambda: status_of(url) == 401)
        assert httpx.get(url, cookies={COOKIE: TOKEN}).status_code == 200
        line = Path(f"/proc/{page.pid}/cmdline").read_bytes()
        assert TOKEN.encode() not in line
        assert b"--token-file" in line
    finally:
        page.terminate()
        page.wait(60.0)


def test_host_that_is_no_address_is_refused() -> None:
    with pytest.raises(ParameterError, match="host must be an IP address or localhost"):
        DashboardParameters(host="my machine").check()


@pytest.mark.slow
def test_command_refuses_before_it_serves(command: Any, tmp_path: Any) -> None:
    finished = command("dashboard", "--host", "0.0.0.0", cwd=tmp_path, code=2)
    assert finished.stderr.startswith("winding: host 0.0.0.0 can be reached from other machines")
