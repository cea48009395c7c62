"""Ten minutes of a live page: no errors in the browser, memory that does not grow; --run-soak."""

import time
from typing import Any

import pytest

pytestmark = [pytest.mark.processes, pytest.mark.slow]

MINUTES = 10.0
# Buffers fill during the first minute (60 s of charts); after that nothing may grow.
SETTLED = 90.0
# Python's allocator and the page's message history move by less; a leak of one message a push
# would be 6000 messages, some 20 MB.
GROWTH_MB = 12.0


@pytest.fixture(scope="module", autouse=True)
def asked_for(request: pytest.FixtureRequest) -> None:
    if not request.config.getoption("--run-soak", default=False):
        pytest.skip("takes ten minutes; asked for with --run-soak")


@pytest.mark.timeout(1500)
@pytest.mark.parametrize("duration", [120.0], indirect=True)
def test_ten_minutes_leave_memory_flat(browser: Any, operated: Any) -> None:
    # Waits evaluate text, which the page's content security policy forbids.
    page = browser.new_page(viewport={"width": 1280, "height": 800}, bypass_csp=True)
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("console", lambda m: complaints.append(m.text) if m.type == "error" else None)
    page.goto(operated.url)
    begin = time.monotonic()
    cpu = operated.server.cpu_times()
    settled = 0.0
    while time.monotonic() - begin < 60.0 * MINUTES:
        keep_winding(page)
        page.wait_for_timeout(1000)
        if not settled and time.monotonic() - begin > SETTLED:
            settled = memory_mb(operated)
    passed = time.monotonic() - begin
    after = operated.server.cpu_times()
    used = (after.user + after.system - cpu.user - cpu.system) / passed
    grown = memory_mb(operated) - settled
    print(f"{settled:.0f} MB after {SETTLED:g} s, {grown:+.1f} MB later; {used:.2f} of a core")
    assert complaints == []
    assert grown < GROWTH_MB


def memory_mb(operated: Any) -> float:
    return float(operated.server.memory_info().rss) / 1e6


def keep_winding(page: Any) -> None:
    """Begin another run whenever the last one is over."""
    phase = page.locator("[data-part=state] .word").inner_text().lower()
    header = page.locator("header")
    if phase == "finished":
        header.get_by_role("button", name="Reset", exact=True).click()
        page.locator("dialog[open]").get_by_role("button", name="Reset").click()
        page.wait_for_function(
            "document.querySelector('#answer').innerText.includes('start of a run')", timeout=60_000
        )
    elif phase in ("ready", "stopped") and header.get_by_role("button", name="Start").is_enabled():
        header.get_by_role("button", name="Start", exact=True).click()
