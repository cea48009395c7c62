"""The panel of the lay's controller in a real browser: it fits, and its switches act."""

from pathlib import Path
from typing import Any

import pytest

pytestmark = [pytest.mark.campaign, pytest.mark.slow]

DRAWN = (
    "document.querySelectorAll('.control .curve').length > 1 && "
    "[...document.querySelectorAll('.control tbody tr')].some(r => r.innerText.endsWith('off'))"
)


@pytest.mark.parametrize("where", ["desk", "phone"])
def test_panel_fits_and_nobody_complains(
    where: str, controlled_page: Any, new_tab: Any, pictures: Path
) -> None:
    tab = new_tab(where, controlled_page.url)
    tab.wait_for(DRAWN)
    tab.shoot(pictures, f"controlled-{where}")
    assert tab.misfits() == []
    assert tab.complaints == []
    assert tab.strangers(controlled_page.url) == []
    # Further tabs take what the next one needs.
    tab.page.close()


def test_switch_asks_acts_and_is_shown(controlled_page: Any, new_tab: Any, serving: Any) -> None:
    tab = new_tab("desk", controlled_page.url)
    tab.wait_for(DRAWN)
    panel = tab.page.get_by_role("region", name="Lay control: wanted, predicted and measured lay")
    panel.get_by_role("button", name="Watch").click()
    tab.answer("Switch to watch")
    serving.wait_for_line(controlled_page.process, "told lay_control_watch")
    tab.said("lay control: done")
    tab.wait_for(
        "document.querySelector('.control').innerText.includes('Watch: says what it would command')"
    )
