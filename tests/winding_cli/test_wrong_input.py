"""Wrong values of any option of any command: one sentence with the option, exit code 2."""

from __future__ import annotations

import random
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from winding_cli.app import app

# What a command needs beside the option under test, so that nothing else is wrong with it.
BESIDE = {
    "run": ["--case", "4"],
    "predict": ["--case", "4"],
    "plan": ["--case", "4", "--even"],
    "render": ["pictures"],
    "board": ["board.png"],
    "sweep": ["spec.yaml"],
}
# They need recordings or a running graph before any option is looked at, or take any text for one.
LEFT_OUT = {"track", "identify", "calibrate", "bag", "conform", "health"}
NUMBERS = ("abc", "-1e9", "nan")
PLACES = ("/dev/null/x", "/proc/nothere/x")


def wrong_inputs() -> Iterator[tuple[str, str, str]]:
    """Yield command, option and a value that is wrong for any option of its type."""
    root: Any = typer.main.get_command(app)
    for name, command in root.commands.items():
        if name in LEFT_OUT:
            continue
        for item in command.params:
            if item.param_type_name != "option" or item.is_flag:
                continue
            kind = item.type_descriptor.annotation
            values = NUMBERS if kind in (int, float) else PLACES if kind is Path else ()
            for value in values:
                yield name, item.opts[0], value


INPUTS = sorted(wrong_inputs())


def chosen(count: int, seed: int) -> list[tuple[str, str, str]]:
    return random.Random(seed).sample(INPUTS, count)


def check(folder: Path, name: str, option: str, value: str) -> None:
    (folder / "spec.yaml").write_text("parameters: {case: [4]}\n", encoding="utf-8")
    words = list(BESIDE.get(name, []))
    if option in words:
        at = words.index(option)
        del words[at : at + 2]
    finished = subprocess.run(
        [sys.executable, "-m", "winding_cli.cli", name, *words, f"{option}={value}"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert finished.returncode == 2, finished.stderr
    assert "Traceback" not in finished.stderr
    assert option in finished.stderr


@pytest.mark.slow
@pytest.mark.parametrize(("name", "option", "value"), chosen(20, 1))
def test_wrong_value_is_refused_with_its_option(
    tmp_path: Path, name: str, option: str, value: str
) -> None:
    check(tmp_path, name, option, value)


@pytest.mark.campaign
@pytest.mark.timeout(3000)
def test_a_hundred_wrong_values_are_refused_with_their_options(tmp_path: Path) -> None:
    for wrong in chosen(100, 2):
        check(tmp_path, *wrong)
