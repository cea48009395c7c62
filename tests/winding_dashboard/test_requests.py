"""Whatever is asked of the page, it answers in words, and goes on serving what it served before."""

import json
import random
from pathlib import Path
from typing import Any

import pytest
from simulated_page import Desk, fresh_state

from winding_dashboard.web.access import OF_REPORTS

DEEP = "[" * 50_000 + "]" * 50_000
JSON = {"content-type": "application/json"}
POSTS = (
    "/command/stop", "/command/start", "/command/lay_control_drive", "/prepare", "/record",
    "/limits", "/recipe/save", "/recipe/load", "/playback",
)  # fmt: skip
ODD = [
    b"",
    b"\xff\xfe{",
    b"null",
    b"[1, 2]",
    b'{"form": NaN}',
    b'{"limits": {"lay_tolerance_mm": 1e999}}',
    b'{"sequence": 1' + b"0" * 4400 + b"}",
    b'{"form": {"case": 1' + b"0" * 320 + b"}}",
    b'{"form": {"case": 4, "law": "\\ud83d"}}',
    b'{"limits": {"\\udc00": 1}}',
    b'{"server": {"a": []}, "sequence": [1], "form": [4], "limits": 7, "on": {}}',
    b'{"form": {"case": [4], "law": {}, "take_up": "x", "fields": [["a", 1], 2]}}',
    b'{"form": {"case": 1e300, "fields": {"tension_n": {"a": 1}, "friction": [1]}}}',
    b'{"limits": {"error_limit_pct": "1", "lay_tolerance_mm": null}}',
    f'{{"form": {DEEP[:40_000]}}}'.encode(),
    DEEP[:90_000].encode(),
    b" " * 2_000_000,
]
PATHS = (
    "/runs/%00", "/runs/" + "a" * 5000, "/runs/%F0%28", "/runs/../../etc/passwd", "/runs/.",
    "/runs/", "/runs/one/report", "/runs/one/report/index.html/further", "/command/",
    "/command/%0a", "/command/%ff", "/command/start/x", "/recipe/", "/%2e%2e/page.js", "/snapshot/",
)  # fmt: skip
QUERIES = (
    "marker=x", "marker=-1", "marker=" + "9" * 5000, "yaw=nan", "pitch=1e400", "yaw=%F0%28",
    "marker=1&marker=2", "&&==&", "yaw=1_0", "token=%ff", "marker=%D9%A1",
)  # fmt: skip


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    report = tmp_path / "one" / "report"
    report.mkdir(parents=True)
    (report / "index.html").write_text("<p>wound</p>")
    return Desk(fresh_state("idle"), runs=tmp_path)


def answered(desk: Desk, method: str, path: str, **more: Any) -> int:
    """Return the status of an answer; the exception of an application that ends is raised here."""
    return desk.request(method, path, **more).status_code


@pytest.mark.parametrize("path", POSTS)
def test_odd_bodies_are_answered_in_words(desk: Desk, path: str) -> None:
    seen = desk.look()
    for body in ODD:
        assert answered(desk, "POST", path, content=body, headers=JSON) in (200, 400)
        # What was asked for is shown to every browser from then on.
        assert desk.look()["server"] == seen["server"]
    for given in ({**JSON, "content-length": "x"}, {**JSON, "content-length": "9" * 5000}, {}):
        assert answered(desk, "POST", path, content=b"{}", headers=given) == 400


def test_odd_paths_methods_queries_and_headers_are_answered_in_words(desk: Desk) -> None:
    for path in PATHS:
        for method in ("GET", "POST", "HEAD", "DELETE", "BREW"):
            assert answered(desk, method, path) in (400, 404, 405)
    for query in QUERIES:
        assert answered(desk, "GET", f"/snapshot?{query}") in (200, 400)
    for name in ("host", "origin", "cookie", "range", "accept-encoding", "if-none-match"):
        for value in (b"http://[", b"[::1", b"\xff\xfe", b"a" * 9000, b",;=", b"bytes=9-1"):
            status = answered(desk, "GET", "/", headers={name: value})
            assert status in ((403,) if name in ("host", "origin") else (200,))
    assert (
        answered(desk, "GET", "/runs/one/report/index.html", headers={"range": "bytes=9-1"}) < 500
    )


def test_random_requests_are_answered_in_words(desk: Desk) -> None:
    chance = random.Random(20_26)
    whole = json.dumps(
        {"server": "first", "sequence": 1, "on": True, "limits": {"lay_tolerance_mm": 0.7},
         "form": {"case": 0, "law": "linear", "take_up": False, "fields": {"tension_n": 3.5}}}
    ).encode()  # fmt: skip
    for _ in range(400):
        body = bytearray(whole)
        for _ in range(chance.randint(1, 4)):
            at = chance.randrange(len(body))
            body[at : at + chance.randint(0, 6)] = chance.randbytes(chance.randint(0, 5))
        path = chance.choice(POSTS) + chance.choice(("", "", "?a", "/", "%00", "\u00e9"))
        status = answered(desk, "POST", path, content=bytes(body), headers=JSON)
        assert status in (200, 307, 400, 404, 405)
    desk.look()


@pytest.mark.parametrize(
    ("path", "content"),
    [
        ("/", "script-src 'self'; style-src 'self';"),
        ("/page.js", "script-src 'self';"),
        ("/snapshot", "frame-ancestors 'none'"),
        ("/nothing", "default-src 'none'"),
        ("/runs/one/report/index.html", OF_REPORTS["content-security-policy"]),
    ],
)
def test_every_answer_says_what_browsers_may_do(desk: Desk, path: str, content: str) -> None:
    for headers in ({}, {"origin": "http://evil.example"}):
        answer = desk.request("GET", path, headers=headers).headers
        policy = answer["content-security-policy"]
        assert headers or content in policy
        assert "script-src 'unsafe" not in policy
        assert "frame-ancestors 'none'" in policy
        assert answer["x-frame-options"] == "DENY"
        assert answer["x-content-type-options"] == "nosniff"
        assert answer["referrer-policy"] == "no-referrer"


@pytest.mark.slow
def test_browser_runs_the_pages_own_script_and_no_other(controlled_page: Any, browser: Any) -> None:
    page = browser.new_page()
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(controlled_page.url)
    page.locator("#clock", has_text=" s").wait_for()
    page.locator(".charts .curve").first.wait_for(state="attached")
    assert page.locator("#emergency_stop").evaluate("e => getComputedStyle(e).fontWeight") != "400"
    assert complaints == []
    page.evaluate("document.body.insertAdjacentHTML('beforeend', '<b onclick=\"hurt()\">x</b>')")
    page.evaluate("document.querySelector('b').click()")
    page.evaluate(
        "document.head.append(Object.assign(document.createElement('script'), {text: 'hurt = 1'}))"
    )
    assert page.evaluate("typeof hurt") == "undefined"
    assert len([text for text in complaints if "Content Security Policy" in text]) == 2
    page.close()
