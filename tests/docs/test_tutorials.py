"""Every tutorial and the gallery run: their `sh` blocks, pasted in order into one shell."""

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

pytestmark = [pytest.mark.campaign, pytest.mark.slow]

Blocks = Callable[[Path], list[str]]
ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
TUTORIALS = [*sorted((DOCS / "tutorials").glob("*.md")), DOCS / "gallery.md"]
PATIENCE = 840.0  # The newcomer's ten minutes, and the kernels of a first start
NEWCOMER = ("predict_lay.py", "winding predict", "winding track", "read_bag.py")  # In this order


def test_every_tutorial_has_something_to_run(shell_blocks: Blocks) -> None:
    assert [page.name for page in TUTORIALS if not shell_blocks(page)] == []


def test_the_newcomer_gets_a_picture_a_cable_a_film_and_a_recording(shell_blocks: Blocks) -> None:
    text = "".join(shell_blocks(DOCS / "tutorials" / "newcomer.md"))
    places = [text.index(command) for command in NEWCOMER]
    assert places == sorted(places)


@pytest.mark.processes
@pytest.mark.timeout(900)
@pytest.mark.parametrize("page", TUTORIALS, ids=lambda page: page.stem)
def test_the_tutorial_works_when_pasted(page: Path, tmp_path: Path, shell_blocks: Blocks) -> None:
    for part in ("examples", "tests", "pyproject.toml"):
        (tmp_path / part).symlink_to(ROOT / part)
    script = "\n".join(["set -euo pipefail", *shell_blocks(page)])
    # A reader's shell is not a test.
    environment = {name: value for name, value in os.environ.items() if "PYTEST" not in name}
    environment["PATH"] = f"{Path(sys.executable).parent}:{environment['PATH']}"
    with (tmp_path / "output.txt").open("w+") as output:
        shell = subprocess.Popen(
            ["bash", "-c", script],
            cwd=tmp_path,
            env=environment,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            code = shell.wait(timeout=PATIENCE)
        finally:
            # What a tutorial leaves in the background ends with it.
            try:
                os.killpg(shell.pid, signal.SIGTERM)
            except ProcessLookupError:
                assert shell.poll() is not None
        output.seek(0)
        printed = output.read()
    assert code == 0, printed
    if page.stem == "first-run":
        shown_run_is_this_one(page, tmp_path / "runs" / "first" / "run.json")


def shown_run_is_this_one(page: Path, record: Path) -> None:
    """Compare the table of markers on the page with a run that was just wound."""
    rows = re.findall(r"^ +P(\d) +(.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    markers = json.loads(record.read_text(encoding="utf-8"))["markers"]
    assert [int(n) for n, _ in rows] == [marker["id"] for marker in markers]
    for (n, cells), marker in zip(rows, markers, strict=True):
        shown = [float(cell) for cell in cells.split()]
        lengths = ("original_m", "s_fem_m", "s_tracked_m")
        # The camera's noise and rounding to a hundredth of a millimetre.
        assert shown[:3] == pytest.approx([1e3 * marker[key] for key in lengths], abs=0.03), n
        assert shown[3] == pytest.approx(marker["h"], abs=2e-4), n
        measured = [1e3 * marker[key] for key in ("s_corrected_m", "s_published_m")]
        assert shown[4:6] == pytest.approx(measured, abs=0.05), n
