"""A run of real processes: its bag is whole, nothing was lost, and its nodes' work repeats."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from winding_recorder.bags.check import check
from winding_recorder.bags.contents import contents
from winding_recorder.playback.replay import replay
from winding_ros import topics

pytestmark = pytest.mark.processes


@pytest.fixture(scope="module")
def bag(recorded_run: Any) -> Path:
    assert recorded_run.finished.returncode == 0, recorded_run.finished.stderr
    return recorded_run.bag


def test_nothing_was_lost_and_every_checksum_holds(bag: Path) -> None:
    assert check(bag).findings == []
    counted = {topic.name: topic.lost for topic in contents(bag).topics}
    assert set(counted.values()) == {0, None}
    # Only where several nodes publish, or strangers do, nobody can count.
    commands = {f"/winding/{topic.name}" for topic in topics.published_by(topics.COMMANDER)}
    uncounted = {name for name, lost in counted.items() if lost is None}
    assert uncounted == {"/diagnostics"} | commands


def test_the_correction_s_answers_come_again_byte_for_byte(bag: Path) -> None:
    result = replay(bag, "correction")
    assert result.agrees
    assert all(c.identical == c.compared > 0 for c in result.comparisons)


def test_the_solver_s_answers_come_again(bag: Path) -> None:
    # Tension that arrives more than 0.2 s late, as on a machine with ten times its load, would
    # be used late in the run and in time in the replay.
    result = replay(bag, "fem")
    assert result.agrees, result.comparisons
    assert all(c.compared > 0 for c in result.comparisons)


def test_the_tracker_s_frames_come_again(bag: Path) -> None:
    result = replay(bag, "tracker")
    assert result.refused == 0
    compared = {item.topic: item for item in result.comparisons}
    markers = compared[f"/winding/{topics.TRACKED_MARKERS.name}"]
    # In the run a frame may have gone without an encoder sample that came too late; in the
    # replay none does.
    assert markers.missing == 0
    assert markers.compared > 900
    assert result.digest == replay(bag, "tracker").digest


def test_the_report_of_a_bag_names_every_topic(bag: Path, command: Callable[..., Any]) -> None:
    said = command("bag", "info", bag, cwd=bag.parent)
    assert said.returncode == 0, said.stderr
    assert "complete: yes" in said.stdout
    for topic in topics.TOPICS:
        assert (topic.name in said.stdout) is topic.recorded


def test_damage_ends_the_check_with_exit_code_one(
    bag: Path, command: Callable[..., Any], tmp_path: Path
) -> None:
    whole = command("bag", "check", bag, cwd=tmp_path)
    assert whole.returncode == 0, whole.stdout
    assert "is whole: " in whole.stdout
    harmed = Path(shutil.copytree(bag, tmp_path / "bag"))
    (file,) = harmed.glob("*.mcap")
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 4
    file.write_bytes(content)
    checked = command("bag", "check", harmed, cwd=tmp_path)
    assert checked.returncode == 1
    assert all(line.startswith("found: ") for line in checked.stdout.splitlines())
    recovered = command("bag", "recover", harmed, tmp_path / "out", cwd=tmp_path)
    assert recovered.returncode == 0, recovered.stderr
    assert "lost: " in recovered.stdout


@pytest.mark.parametrize("action", ["info", "check", "replay", "play"])
def test_a_folder_that_is_no_recording_is_refused_in_one_sentence(
    command: Callable[..., Any], tmp_path: Path, action: str
) -> None:
    options = ["--node", "fem", "--parameters", "p.yaml"] if action == "replay" else []
    (tmp_path / "p.yaml").write_text("{}")
    refused = command("bag", action, tmp_path, *options, cwd=tmp_path)
    assert refused.returncode == 1
    assert len(refused.stderr.strip().splitlines()) == 1
    assert "winding: " in refused.stderr
