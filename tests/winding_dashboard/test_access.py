"""Who reaches the page, and who is refused before anything is served."""

import asyncio
from typing import Any

import httpx
import pytest

from winding_core.parameters import ParameterError
from winding_dashboard.ros.parameters import DashboardParameters
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
    refused = get("http://127.0.0.1:8080/", origin="http://evil.example")
    assert refused.status_code == 403
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


def test_open_address_without_a_token_is_refused() -> None:
    for host in ("0.0.0.0", "192.168.1.4", "::"):
        with pytest.raises(ParameterError, match="token needs at least 16 characters, got 0"):
            DashboardParameters(host=host).check()
        DashboardParameters(host=host, token=TOKEN).check()


def test_host_that_is_no_address_is_refused() -> None:
    with pytest.raises(ParameterError, match="host must be an IP address or localhost"):
        DashboardParameters(host="my machine").check()


@pytest.mark.slow
def test_command_refuses_before_it_serves(command: Any, tmp_path: Any) -> None:
    finished = command("dashboard", "--host", "0.0.0.0", cwd=tmp_path)
    assert finished.returncode == 2
    assert finished.stderr.startswith("winding: host 0.0.0.0 can be reached from other machines")
