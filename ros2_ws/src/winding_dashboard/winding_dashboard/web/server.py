"""The page's web server: the page, its snapshots, the operators' requests, and the reports."""

from __future__ import annotations

import json
import math
from collections.abc import Awaitable, Callable, Mapping
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import (
    FileResponse,
    HTMLResponse,
    JSONResponse,
    PlainTextResponse,
    Response,
)
from starlette.routing import Route

from winding_dashboard.drawings.cylinder_view import Sight
from winding_dashboard.page.commands import STOPS, TITLES
from winding_dashboard.page.session import OperatorSession
from winding_dashboard.page.snapshot import Snapshots, Wanted
from winding_dashboard.state.marker_rows import MOST_MARKERS
from winding_dashboard.web.access import OF_REPORTS, Gate

_DATA = Path(__file__).parents[1] / "data"
_COMPRESSED_FROM = 1000
# Who asks for motion must have seen the machine as it was so lately [s].
SEEN_WITHIN = 5.0
_LARGEST_REQUEST = 100_000
# Digits of a whole number that counts snapshots or picks a case.
_LONGEST_NUMBER = 15
_STEEPEST = 80.0

Lifespan = Callable[[Starlette], AbstractAsyncContextManager[None]]


def application(
    snapshots: Snapshots, page: str, *, token: str, host: str, lifespan: Lifespan | None = None
) -> Starlette:
    """Return the ASGI application.

    Args:
        snapshots: What is shown, of the session that does what operators ask for.
        page: HTML of the page without any value of the run.
        token: Secret that a browser must bring; empty for none.
        host: Address that is served.
        lifespan: What goes on while it serves.
    """
    pages = _Pages(snapshots, page)
    return Starlette(
        routes=[
            Route("/", pages.page),
            *(Route(f"/{name}", pages.data) for name in ("page.css", "page.js")),
            Route("/snapshot", pages.snapshot),
            *(Route(f"/{name}", pages.act, methods=["POST"]) for name in pages.actions),
            Route("/runs/{path:path}", pages.report),
            Route("/{path:path}", pages.nothing, methods=["GET", "POST"]),
        ],
        middleware=[
            Middleware(Gate, token=token, host=host),
            Middleware(GZipMiddleware, minimum_size=_COMPRESSED_FROM),
        ],
        lifespan=lifespan,
    )


@dataclass(frozen=True, kw_only=True)
class _Action:
    """What a browser can ask for."""

    what: str  # Its name in an answer
    do: Callable[[Mapping[str, Any]], Awaitable[str]]  # Takes what the request brings
    always: bool = False  # Whether it is done whatever was seen


def _actions(session: OperatorSession) -> dict[str, _Action]:
    """Return every action by its path."""

    def command(name: str) -> _Action:
        return _Action(what=TITLES[name], do=lambda _: session.command(name), always=name in STOPS)

    def recipe(do: Callable[[Mapping[str, Any]], Awaitable[str]]) -> _Action:
        return _Action(what="recipe", do=do, always=True)

    return {f"command/{name}": command(name) for name in TITLES} | {
        "prepare": _Action(what="prepare", do=lambda body: session.prepare(_object(body, "form"))),
        "record": _Action(
            what="recording", do=lambda body: session.record(on=bool(body.get("on")))
        ),
        "limits": _Action(
            what="limits", do=lambda body: session.set_limits(_object(body, "limits")), always=True
        ),
        "playback": _Action(what="playback", do=session.play, always=True),
        "recipe/save": recipe(
            lambda body: session.save_recipe(str(body.get("name")), _object(body, "form"))
        ),
        "recipe/load": recipe(lambda body: session.load_recipe(str(body.get("name")))),
    }


class _Pages:
    def __init__(self, snapshots: Snapshots, page: str) -> None:
        self._session, self._snapshots, self._page = snapshots.session, snapshots, page
        self.actions = _actions(snapshots.session)

    async def page(self, _: Request) -> Response:
        return HTMLResponse(self._page, headers={"Cache-Control": "no-store"})

    async def data(self, request: Request) -> Response:
        path = _DATA / request.url.path[1:]
        return FileResponse(path, headers={"Cache-Control": "no-cache"})

    async def snapshot(self, request: Request) -> Response:
        try:
            wanted = _wanted(request.query_params)
        except ValueError as error:
            return PlainTextResponse(str(error), 400)
        headers = {"Cache-Control": "no-store"}
        # Packing costs more time than it saves on loopback and on a local network.
        headers["Content-Encoding"] = "identity"
        return JSONResponse(self._snapshots.snapshot(wanted), headers=headers)

    async def nothing(self, request: Request) -> Response:
        return PlainTextResponse(f"there is no page {request.url.path}; the page is at /", 404)

    async def report(self, request: Request) -> Response:
        path = str(request.path_params["path"])
        try:
            file = self._snapshots.runs.file(path)
            found = None if file is None else file.stat()
        except (OSError, ValueError):
            # No file system takes such a name, or the file has just gone.
            file = None
        if file is None:
            return PlainTextResponse(f"there is no report {path}", 404)
        return FileResponse(file, stat_result=found, headers=OF_REPORTS)

    async def act(self, request: Request) -> Response:
        """Do what is asked for, unless the request rests on an old snapshot."""
        action = self.actions[request.url.path[1:]]
        body = await _json(request)
        if body is None:
            return PlainTextResponse("the request must be a JSON object", 400)
        self._session.loaded = {}
        age = self._snapshots.age(body.get("server"), body.get("sequence"))
        if age > SEEN_WITHIN and not action.always:
            seen = f"{age:.0f} s old" if math.isfinite(age) else "too old"
            reason = f"nothing was done, for the page was {seen}; look again"
            self._session.refuse(action.what, reason)
        else:
            await self._session.ask(action.what, action.do(body))
        self._snapshots.changed()
        answer = {"answer": self._session.answer, "refused": self._session.alarm}
        return JSONResponse({**answer, "form": self._session.loaded})


async def _json(request: Request) -> dict[str, Any] | None:
    """Return the object that a request brings; None for anything that cannot be written again."""
    # A form of another site cannot send this type.
    if request.headers.get("content-type", "").split(";")[0] != "application/json":
        return None
    length = request.headers.get("content-length", "")
    if not (length.isdecimal() and len(length) <= _LONGEST_NUMBER):
        return None
    if int(length) >= _LARGEST_REQUEST:
        return None
    try:
        body = json.loads(await request.body(), parse_int=_whole_number)
        # Neither infinite numbers nor halves of characters, which no answer could repeat.
        json.dumps(body, ensure_ascii=False, allow_nan=False).encode()
    except (ValueError, RecursionError, ClientDisconnect):
        return None
    return body if isinstance(body, dict) else None


def _object(body: Mapping[str, Any], name: str) -> dict[str, Any]:
    found = body.get(name)
    return found if isinstance(found, dict) else {}


def _whole_number(text: str) -> int:
    """Return a whole number of a request.

    Raises:
        ValueError: It has too many digits.
    """
    if len(text) > _LONGEST_NUMBER:
        raise ValueError(f"a whole number has at most {_LONGEST_NUMBER} digits, got {len(text)}")
    return int(text)


def _wanted(query: Mapping[str, str]) -> Wanted:
    """Return what a browser looks at.

    Raises:
        ValueError: A number is none, or outside its limits.
    """
    default = Sight()
    marker = int(query.get("marker", "0"))
    if not 0 <= marker <= MOST_MARKERS:
        raise ValueError(f"marker must be from 0 to {MOST_MARKERS}, got {marker}")
    angles = []
    for name, usual in (("yaw", default.yaw), ("pitch", default.pitch)):
        degrees = float(query.get(name, math.degrees(usual)))
        if not abs(degrees) <= _STEEPEST:
            raise ValueError(f"{name} must be within {_STEEPEST:g} degrees, got {degrees:g}")
        angles.append(math.radians(degrees))
    return Wanted(marker=marker, sight=Sight(yaw=angles[0], pitch=angles[1]))
