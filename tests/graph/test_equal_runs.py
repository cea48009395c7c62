"""Two runs of the same seed record the same bytes."""

from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from winding_recorder.bags.reading import opened

pytestmark = [pytest.mark.processes, pytest.mark.slow]

# It tells of processes and wall time as well. An identification does so too, when a marker has
# landed: later than these runs end.
OF_THE_WALL_CLOCK = "/diagnostics"


def recorded(bag: Path) -> dict[str, list[tuple[int, bytes]]]:
    messages = defaultdict(list)
    with opened(bag) as reader:
        for link, stamp, data in reader.messages():
            messages[link.topic].append((stamp, bytes(data)))
    return messages


def test_equal_runs_record_equal_bytes(tmp_path: Path, command: Callable[..., Any]) -> None:
    for name in ("one", "other"):
        done = command(
            *("run", "--case", 4, "--duration-s", 3, "--speed", 0),
            *("--bag", tmp_path / name, "--output", tmp_path / f"{name}-run"),
            cwd=tmp_path,
        )
        assert done.returncode == 0, done.stdout + done.stderr
    one, other = recorded(tmp_path / "one"), recorded(tmp_path / "other")
    assert one.keys() == other.keys()
    differing = [topic for topic in one if one[topic] != other[topic]]
    assert differing in ([], [OF_THE_WALL_CLOCK])
    assert len(one) > 10
