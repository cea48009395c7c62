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
    assert tab.foreign_requests(controlled_page.url) == []
    # Further tabs take what the next one needs.
    tab.page.close()


def test_layers_of_a_drum_are_unrolled(controlled_page: Any, new_tab: Any, pictures: Path) -> None:
    tab = new_tab("desk", controlled_page.url)
    chart = tab.page.get_by_role("img", name="Unrolled surface of the drum by layer")
    for layer in (1, 2, 3):
        chart.locator(f".curve.layer-{layer}").first.wait_for(state="attached")
        chart.locator(f".dots.layer-{layer}").first.wait_for(state="attached")
    assert chart.locator(".is-fault").count() == 1
    # No line goes back across the picture where a turn ends.
    longest = chart.evaluate(
        "svg => Math.max(...[...svg.querySelectorAll('.curve')].flatMap(path => {"
        "const x = path.getAttribute('d').slice(1).split('L').map(p => +p.split(' ')[0]);"
        "return x.slice(1).map((value, i) => x[i] - value)}))"
    )
    assert longest <= 0.0
    chart.screenshot(path=str(pictures / "layers.png"))


def test_switch_asks_acts_and_is_shown(controlled_page: Any, new_tab: Any) -> None:
    tab = new_tab("desk", controlled_page.url)
    tab.wait_for(DRAWN)
    panel = tab.page.get_by_role("region", name="Lay control: wanted, predicted and measured lay")
    panel.get_by_role("button", name="Watch").click()
    tab.answer("Switch to watch")
    assert controlled_page.process.stdout.readline() == "asked lay_control_watch\n"
    tab.answered("lay control: done")
    tab.wait_for(
        "document.querySelector('.control').innerText"
        ".includes('Watch: shows what it would command')"
    )


def test_typed_values_stay_when_another_tab_prepares(standing_page: Any, new_tab: Any) -> None:
    first, second = (new_tab("desk", standing_page.url) for _ in range(2))
    for tab in (first, second):
        tab.wait_for("document.querySelector('[name=case]').value !== ''")
    setup = first.page.get_by_role("region", name="Next run")
    setup.get_by_label("Case").select_option("0")
    setup.get_by_label("Cylinder diameter, mm").fill("33")
    first.page.get_by_label("Error of a length, %").fill("7.25")
    other = second.page.get_by_role("region", name="Next run")
    other.get_by_label("Case").select_option("7")
    other.get_by_role("button", name="Prepare").click()
    second.answered("ready to wind case 7")
    setup.get_by_text("has been set elsewhere").wait_for()
    assert setup.get_by_label("Case").input_value() == "0"
    assert setup.get_by_label("Cylinder diameter, mm").input_value() == "33"
    assert first.page.get_by_label("Error of a length, %").input_value() == "7.25"
    setup.get_by_role("button", name="Discard changes").click()
    first.wait_for("document.querySelector('[name=case]').value === '7'")
    assert setup.get_by_label("Cylinder diameter, mm").input_value() == ""


def test_limit_that_is_refused_or_empty_changes_nothing(standing_page: Any, new_tab: Any) -> None:
    tab = new_tab("desk", standing_page.url)
    holds = "document.querySelector('[name=error_limit_pct]').value === '4.8'"
    tab.wait_for(holds)
    field = tab.page.get_by_label("Error of a length, %")
    for typed, sentence in (("-2.5", "must be positive, got -2.5"), ("", "% is empty")):
        field.fill(typed)
        tab.page.get_by_role("button", name="Set", exact=True).click()
        tab.answered(sentence)
        tab.wait_for(holds)
