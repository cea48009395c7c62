"""A bag that is played is shown as what it is, with everything that was recorded in it."""

import json
import subprocess
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from processes import COMMAND, serving

pytestmark = [pytest.mark.campaign, pytest.mark.processes, pytest.mark.slow]

MARKERS = "[...document.querySelectorAll('#markers tbody tr')].map(r => r.innerText.split('\\t'))"


@pytest.fixture
def page_url() -> Iterator[str]:
    with serving(*COMMAND, "dashboard", "--port") as page:
        yield page.url


def test_a_played_bag_looks_like_playback(
    recorded_run: Any, page_url: str, new_tab: Callable[[str, str], Any], pictures: Any
) -> None:
    desk = new_tab("desk", page_url)
    desk.phase("no data")
    player = subprocess.Popen([*COMMAND, "bag", "play", str(recorded_run.bag)])
    try:
        desk.phase("playback")
        desk.wait_for("parseFloat(document.querySelector('#clock').innerText) > 0.3")
        clock: list[float] = []
        while player.poll() is None:
            shown = desk.measured("document.querySelector('#clock').innerText")
            clock.append(float(shown.removesuffix(" s")))
        assert player.returncode == 0
    finally:
        player.kill()
    desk.wait_for(f"document.querySelector('#clock').innerText.startsWith('{5.0:.1f}')")
    assert clock == sorted(clock)
    assert len(set(clock)) > 5
    for name in ("Start", "Reset", "EMERGENCY STOP"):
        assert desk.button(name).is_disabled()
    reason = "a recording is played; there is no machine"
    assert desk.page.locator("#recorded").inner_text() == reason
    assert desk.page.locator("#recording").is_hidden()
    band = desk.page.locator("#band").inner_text()
    assert "case 4" in band.lower()
    desk.shoot(pictures, "played")
    rows = desk.measured(MARKERS)
    print(band, rows)
    recorded = json.loads(recorded_run.json.read_text(encoding="utf-8"))["markers"][0]
    assert any(f"{1e3 * recorded['s_corrected_m']:.2f}" in cell for cell in rows[0])
    assert desk.misfits() == []
    assert desk.complaints == []


def test_slider_pauses_a_played_bag_and_goes_to_a_place(
    recorded_run: Any, page_url: str, new_tab: Callable[[str, str], Any], pictures: Any
) -> None:
    tab = new_tab("phone", page_url)
    player = subprocess.Popen(
        [*COMMAND, "bag", "play", str(recorded_run.bag), "--loop", "--rate", "0.5"]
    )
    try:
        slider = tab.page.get_by_label("Place in the recording, s")
        slider.wait_for()
        tab.page.get_by_role("button", name="Pause", exact=True).click()
        tab.page.get_by_role("button", name="Go on", exact=True).wait_for()
        length, time = tab.measured("shown.playback.length"), tab.measured("shown.time ?? 0")
        # Places of the recording go by arrival, which keeps the order of the machine's clock.
        for share, order in ((0.8, ">"), (0.3, "<"), (0.9, ">")):
            place = f"{share * length:.1f}"
            slider.fill(place)
            tab.wait_for(f"Math.abs(shown.playback.position - {place}) < 0.01")
            tab.wait_for(f"shown.time {order} {time} + {0.0 if order == '<' else 0.5}")
            time = tab.measured("shown.time")
            tab.wait_for("document.querySelector('#markers tbody tr')")
            tab.wait_for("document.querySelector('#band').innerText.includes('CASE 4')")
        tab.shoot(pictures, "slider")
        assert tab.misfits() == []
        tab.page.get_by_role("button", name="Go on", exact=True).click()
        tab.wait_for(f"shown.playback.position > {place} + 0.05")
        assert tab.complaints == []
    finally:
        player.kill()
        player.wait()
