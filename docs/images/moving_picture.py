"""Moving pictures for the README: a recorded run, and the operator's page beside a run.

    winding run --case 4 --speed 0 --output run --bag run/bag
    python docs/images/moving_picture.py run run/bag docs/images/run-case-4.webp
    python docs/images/moving_picture.py page http://127.0.0.1:8090/ docs/images/page.webp

The second needs a page that is up, beside a run or a played recording, playwright and Chromium.
"""

from __future__ import annotations

import argparse
import io
import sys
from collections.abc import Sequence
from pathlib import Path

import recorded_pictures
from PIL import Image

LARGEST = 2_000_000
# Of the page: one picture each [ms], how many, and its viewport [px].
PAGE_PERIOD_MS, PAGE_PICTURES = 200, 65
VIEWPORT = {"width": 1280, "height": 800}
CHROMIUM = "/usr/bin/chromium"
WIDTH = 960


def main() -> None:
    """Write the moving picture that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    kinds = parser.add_subparsers(dest="kind", required=True)
    run = kinds.add_parser("run", help="of a recording")
    run.add_argument("bag", type=Path)
    page = kinds.add_parser("page", help="of the operator's page, now")
    page.add_argument("url")
    page.add_argument("--chromium", default=CHROMIUM, help="the browser's program")
    page.add_argument("--seconds", type=float, default=PAGE_PICTURES * PAGE_PERIOD_MS / 1000)
    for kind in (run, page):
        kind.add_argument("output", type=Path)
        kind.add_argument("--quality", type=int, default=60, help="of the WebP, 0 to 100")
    asked = parser.parse_args()
    if asked.kind == "run":
        pictures, shown = recorded_pictures.pictures(asked.bag)
    else:
        pictures = page_pictures(asked.url, asked.chromium, asked.seconds)
        shown = [PAGE_PERIOD_MS] * len(pictures)
    write(asked.output, pictures, shown, asked.quality)


def page_pictures(url: str, chromium: str, seconds: float) -> list[Image.Image]:
    """Return screenshots of a page, one every `PAGE_PERIOD_MS`.

    Args:
        url: Of a page that is up.
        chromium: The browser's program.
        seconds: For how long [s].
    """
    from playwright.sync_api import sync_playwright  # noqa: PLC0415

    found = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=chromium, args=["--no-sandbox", "--disable-gpu"]
        )
        tab = browser.new_page(viewport=VIEWPORT)
        tab.goto(url)
        tab.wait_for_selector("#band .word")
        for _ in range(round(1000 * seconds / PAGE_PERIOD_MS)):
            shot = Image.open(io.BytesIO(tab.screenshot())).convert("RGB")
            found.append(shot.resize((WIDTH, round(WIDTH * shot.height / shot.width))))
            tab.wait_for_timeout(PAGE_PERIOD_MS)
        browser.close()
    return found


def write(path: Path, pictures: Sequence[Image.Image], shown: list[int], quality: int) -> None:
    """Write a WebP that repeats for ever; end the command when it is too large.

    Args:
        path: Of the file.
        pictures: One after the other, of one size.
        shown: How long each is shown [ms], shape (n,).
        quality: 0 to 100.
    """
    first, *others = pictures
    first.save(
        path, save_all=True, append_images=others, duration=shown, loop=0,
        quality=quality, method=4, minimize_size=True,
    )  # fmt: skip
    size = path.stat().st_size
    print(f"{path}: {len(pictures)} pictures, {sum(shown) / 1e3:.1f} s, {size / 1e6:.2f} MB")
    if size > LARGEST:
        sys.exit(f"{path} has {size} bytes, at most {LARGEST}: lower --quality")


if __name__ == "__main__":
    main()
