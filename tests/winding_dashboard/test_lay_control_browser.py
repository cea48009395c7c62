"""The panel of the lay's controller in a real browser: it fits, and its switches act."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytestmark = [pytest.mark.campaign, pytest.mark.slow]

DRAWN = (
    "document.querySelector('.control canvas') !== null && "
    "[...document.querySelectorAll('.control tbody tr')].some(r => r.innerText.endsWith('off'))"
)


@pytest.fixture(scope="module")
def served(serving: Any) -> Iterator[tuple[str, "subprocess.Popen[str]"]]:
    port = serving.free_port()
    process = subprocess.Popen(
        [sys.executable, str(Path(__file__).parent / "controlled_page.py"), str(port)],
        stdout=subprocess.PIPE, text=True, env=serving.environment(),
    )  # fmt: skip
    try:
        url = f"http://127.0.0.1:{port}/"
        serving.wait_for_page(url)
        yield url, process
    finally:
        process.terminate()
        process.wait(30.0)


@pytest.mark.parametrize("where", ["desk", "phone"])
def test_panel_fits_and_nobody_complains(
    where: str, served: tuple[str, Any], new_tab: Any, pictures: Path
) -> None:
    tab = new_tab(where, served[0])
    tab.wait_for(DRAWN)
    tab.shoot(pictures, f"controlled-{where}")
    assert tab.misfits() == []
    assert tab.complaints == []
    assert tab.strangers(served[0]) == []
    # Further tabs take what the next one needs.
    tab.page.close()


def test_switch_asks_acts_and_is_shown(served: tuple[str, Any], new_tab: Any, serving: Any) -> None:
    tab = new_tab("desk", served[0])
    tab.wait_for(DRAWN)
    panel = tab.page.get_by_role("region", name="Lay control")
    panel.get_by_role("button", name="Watch").click()
    tab.page.locator(".q-dialog").get_by_role("button", name="Switch to watch").click()
    serving.wait_for_line(served[1], "told lay_control_watch")
    tab.said("lay control: done")
    tab.wait_for(
        "document.querySelector('.control').innerText.includes('Watch: says what it would command')"
    )
