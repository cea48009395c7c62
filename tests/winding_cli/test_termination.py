"""Signals, closed pipes and full disks: one sentence and the exit code that belongs to it."""

import os
import signal
import sys
from pathlib import Path
from typing import Any

import pytest
import typer

from processes import python, ran
from winding_cli.terminal.output_path import (
    UNFINISHED,
    check_output_file,
    check_output_folder,
    staged,
)
from winding_cli.terminal.termination import interruptible, uninterrupted

# The second signal comes while the first one's work is being closed.
INTERRUPTED_TWICE = """
import signal, subprocess, sys
from winding_cli.terminal.termination import interruptible

child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
try:
    with interruptible():
        try:
            signal.raise_signal(signal.SIGTERM)
        finally:
            signal.raise_signal(signal.SIGTERM)
            print("closed, child", child.wait(60.0))
except KeyboardInterrupt:
    print("interrupted")
"""


def test_second_signal_kills_the_children_and_lets_closing_go_on() -> None:
    done = python(INTERRUPTED_TWICE, check=True)
    assert done.stdout.splitlines() == ["closed, child -9", "interrupted"]


def test_signal_waits_for_a_file_to_be_written() -> None:
    written = []

    def write() -> None:
        with interruptible(), uninterrupted():
            signal.raise_signal(signal.SIGTERM)
            written.append("whole")

    with pytest.raises(KeyboardInterrupt):
        write()
    assert written == ["whole"]
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_staged_file_is_whole_or_absent(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"

    def interrupted() -> None:
        with staged(path) as place:
            place.write_text("half")
            signal.raise_signal(signal.SIGTERM)

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert list(tmp_path.iterdir()) == []
    with staged(path) as place:
        place.write_text("whole")
        assert place.parent.name.endswith(UNFINISHED)
    assert path.read_text() == "whole"
    assert list(tmp_path.iterdir()) == [path]


def test_staged_folder_replaces_its_own_files_alone(tmp_path: Path) -> None:
    (tmp_path / "report").mkdir()
    (tmp_path / "report" / "mine").write_text("mine")
    (tmp_path / "report" / "index.html").write_text("old")
    with staged(tmp_path / "report") as place:
        place.mkdir()
        (place / "index.html").write_text("new")
    found = {path.name: path.read_text() for path in (tmp_path / "report").iterdir()}
    assert found == {"mine": "mine", "index.html": "new"}


def test_link_is_written_through_and_not_replaced(tmp_path: Path) -> None:
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "target")
    with staged(link) as place:
        place.write_text("text")
    assert link.is_symlink()
    assert (tmp_path / "target").read_text() == "text"


def test_place_that_cannot_be_written_is_refused(tmp_path: Path, capsys: Any) -> None:
    (tmp_path / "file").touch()
    refused = [
        (lambda: check_output_file(tmp_path), "is a folder, not a file"),
        (lambda: check_output_file(tmp_path / "no" / "x.json"), "there is no folder"),
        (lambda: check_output_folder(tmp_path / "file"), "is not a folder"),
        (lambda: check_output_folder(tmp_path, new=True), "exists already"),
    ]
    for check, sentence in refused:
        with pytest.raises(typer.Exit) as ended:
            check()
        assert ended.value.exit_code == 2
        assert sentence in capsys.readouterr().err
    check_output_file(Path(os.devnull))
    check_output_folder(tmp_path / "new" / "folder", new=True)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_full_disk_is_refused_before_anything_starts(small_disk: Path, capsys: Any) -> None:
    with pytest.raises(OSError, match="No space"):
        (small_disk / "full").write_bytes(bytes(2_000_000))
    with pytest.raises(typer.Exit):
        check_output_file(small_disk / "out.json")
    assert "No space left on device" in capsys.readouterr().err


def output_to(target: str) -> tuple[int, str]:
    """Return exit code and stderr of a command whose output goes through the shell."""
    line = f'set -o pipefail; "{sys.executable}" -m winding_cli.cli graph {target}'
    done = ran("bash", "-c", line, timeout=120.0)
    return done.returncode, done.stderr


@pytest.mark.slow
def test_output_that_is_not_read_ends_the_command_in_silence() -> None:
    assert output_to("--interfaces | true") == (141, "")


@pytest.mark.slow
def test_output_that_is_full_is_reported_in_one_sentence() -> None:
    code, stderr = output_to("> /dev/full")
    assert code == 1
    assert stderr == "winding: cannot write to standard output: No space left on device\n"
