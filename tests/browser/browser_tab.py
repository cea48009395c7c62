"""A page of a real browser, with what it complained about, and whether all of it fits."""

import time
from pathlib import Path
from typing import Any

TAB_PATIENCE = 60.0  # Ten times what the page takes, on two busy cores [s]
# Labels whose text does not fit their box, or that stick out of their card.
CLIPPED = """
() => [...document.querySelectorAll('.card, header')].flatMap(card => {
  const room = card.getBoundingClientRect();
  return [...card.querySelectorAll('p, button, label, th, td')].filter(item => {
    const box = item.getBoundingClientRect();
    return box.width > 0 && !item.closest('.scene') && !item.closest('.buttons') &&
      (item.scrollWidth > item.clientWidth + 1 && getComputedStyle(item).display !== 'inline' ||
       box.right > room.right + 1 || box.left < room.left - 1);
  }).map(item => item.innerText);
})
"""
WIDE = """
() => [...document.querySelectorAll('body *')]
  .filter(item => !item.closest('svg'))
  .map(item => [item, item.getBoundingClientRect()])
  .filter(([, box]) => box.width > 0 && box.right > document.documentElement.clientWidth + 1)
  .map(([item, box]) => `${item.tagName}.${item.className} to ${Math.round(box.right)}`)
  .slice(0, 8)
"""
# Cards and the header's parts may touch, not cover each other.
OVERLAPPING = """
() => {
  const found = [];
  for (const group of ['.card', 'header > *']) {
    const boxes = [...document.querySelectorAll(group)]
      .filter(item => getComputedStyle(item).position !== 'fixed')
      .map(item => [item.className, item.getBoundingClientRect()])
      .filter(([, box]) => box.width > 0 && box.height > 0);
    for (let i = 0; i < boxes.length; i++) for (let j = i + 1; j < boxes.length; j++) {
      const [a, b] = [boxes[i][1], boxes[j][1]];
      if (a.left < b.right - 1 && b.left < a.right - 1 &&
          a.top < b.bottom - 1 && b.top < a.bottom - 1)
        found.push(boxes[i][0] + ' / ' + boxes[j][0]);
    }
  }
  return found;
}
"""


class Tab:
    """A page with what it complained about and whom it asked."""

    def __init__(self, browser: Any, size: tuple[int, int]) -> None:
        # Waits evaluate text, which the page's content security policy forbids.
        self.page = browser.new_page(
            viewport={"width": size[0], "height": size[1]}, bypass_csp=True
        )
        self.page.set_default_timeout(1000.0 * TAB_PATIENCE)
        self.complaints: list[str] = []
        self.asked: list[str] = []
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("console", self._note)
        self.page.on("request", lambda request: self.asked.append(request.url))

    def _note(self, message: Any) -> None:
        if message.type == "error":
            self.complaints.append(message.text)

    def button(self, name: str) -> Any:
        return self.page.locator("header").get_by_role("button", name=name, exact=True)

    def wait_for(self, script: str) -> None:
        self.page.wait_for_function(script)

    def phase(self, text: str) -> None:
        """Wait until the band shows what the machine does."""
        self.wait_for(
            "document.querySelector('[data-part=state] .word')?.innerText.toLowerCase() === "
            f"'{text}'"
        )

    def can(self, name: str) -> None:
        """Wait until a button of the header can be used."""
        self.wait_for(
            "[...document.querySelectorAll('header button')]"
            f".find(b => b.innerText === '{name}').disabled === false"
        )

    def answer(self, name: str) -> None:
        """Click a button of the question that is open."""
        self.page.locator("dialog[open]").get_by_role("button", name=name, exact=True).click()

    def answered(self, text: str) -> None:
        """Wait until the page shows the outcome of the last command."""
        self.wait_for(f"document.querySelector('#answer').innerText.includes({text!r})")

    def click_time(self, name: str) -> float:
        """Click a button and return the time of its click event [s since the epoch]."""
        self.button(name).evaluate(
            "b => b.addEventListener('click', () => { window.clicked = Date.now() }, {once: true})"
        )
        self.button(name).click()
        return float(self.page.evaluate("window.clicked")) / 1000.0

    def shoot(self, folder: Path, name: str) -> None:
        """Take pictures of what is seen first and of the whole page."""
        # What sticks to the top would stand in the middle of the whole.
        self.page.evaluate("window.scrollTo(0, 0)")
        self.page.screenshot(path=folder / f"{name}.png")
        self.page.screenshot(path=folder / f"{name}-whole.png", full_page=True)

    def misfits(self) -> list[str]:
        """Return what sticks out, is clipped or covers something else."""
        wide, room = self.measured(
            "[document.documentElement.scrollWidth, document.documentElement.clientWidth]"
        )
        found = []
        if wide > room:
            found = [f"the page is {wide} wide in {room}", *self.measured(WIDE)]
        return found + self.measured(CLIPPED) + self.measured(OVERLAPPING)

    def measured(self, script: str) -> Any:
        """Evaluate a script; a page whose connection broke meanwhile loads itself again."""
        from playwright.sync_api import Error

        end = time.monotonic() + TAB_PATIENCE
        while True:
            try:
                return self.page.evaluate(script)
            except Error as error:
                if "context was destroyed" not in str(error) or time.monotonic() > end:
                    raise
                self.page.wait_for_load_state()

    def foreign_requests(self, url: str) -> list[str]:
        """Return who else was asked for something."""
        own = (url, url.replace("http", "ws"), "data:", "blob:")
        return [asked for asked in self.asked if not asked.startswith(own)]
