"""`winding run --machine-file`: an arm of six joints winds what the carriage winds."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from arm_example import EXAMPLE, arm_file

from winding_core.cable.cases import paper_case
from winding_recorder.bags.reading import messages_of, opened

pytestmark = [pytest.mark.processes, pytest.mark.timeout(600)]

RHO, FREE = paper_case(4).centreline_radius, 0.198
# P1 has landed, and P2 is wound at the end; the lay is the machine's own.
RUN = ("--case", 4, "--duration-s", 9, "--speed", 0, "--lay", "driven", "--seed", 5)
# The specification's bars: beside a carriage's run, and of tracked lengths.
SAME, TRACKED = 1.0e-3, 2.0e-3


def numbers(folder: Path) -> list[dict[str, Any]]:
    record: dict[str, Any] = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    return [row for row in record["markers"] if row["s_tracked_m"] is not None]


def test_arm_lays_what_the_carriage_lays(command: Callable[..., Any], tmp_path: Path) -> None:
    for name, further in (("slid", ()), ("led", ("--machine-file", EXAMPLE))):
        command("run", *RUN, *further, "--output", tmp_path / name, cwd=tmp_path, code=0)
    slid, led = numbers(tmp_path / "slid"), numbers(tmp_path / "led")
    assert len(slid) == len(led) >= 1
    for one, other in zip(slid, led, strict=True):
        for key in ("s_fem_m", "s_tracked_m", "s_corrected_m"):
            assert other[key] == pytest.approx(one[key], rel=SAME), key


def test_span_that_grows_is_wound_predicted_and_tracked(command: Any, tmp_path: Path) -> None:
    file = arm_file(tmp_path, path={"along_m": [0.0, 0.03], "span_m": [FREE, 1.3 * FREE]})
    run, bag, truth = tmp_path / "run", tmp_path / "bag", tmp_path / "truth.json"
    command(
        *("run", *RUN, "--machine-file", file),
        *("--output", run, "--bag", bag, "--truth", truth),
        cwd=tmp_path,
        code=0,
    )
    laid = json.loads(truth.read_text(encoding="utf-8"))["markers"]
    markers = numbers(run)
    assert len(markers) >= 1
    for row, theta, z in zip(markers, laid["theta"][1:], laid["z"][1:], strict=False):
        true = math.hypot(RHO * theta, z)
        assert row["s_tracked_m"] == pytest.approx(true, rel=TRACKED)
    with opened(bag) as reader:
        links = [link for link in reader.connections if link.topic.endswith("rig/joint_states")]
        *_, (link, _, data) = messages_of(reader, links)
        last = reader.deserialize(data, link.msgtype)
    at = dict(zip(last.name, last.position, strict=True))
    assert at["guide_y_joint"] == pytest.approx(-1.3 * FREE, abs=2.0e-4)
    assert "shoulder_pan_joint" in at


def test_way_that_the_arm_does_not_reach_is_refused_at_once(command: Any, tmp_path: Path) -> None:
    done = command(
        *("run", "--case", 4, "--duration-s", 100, "--machine-file", EXAMPLE), cwd=tmp_path, code=2
    )
    assert "the guide would go to 0.4975 m, beyond its travel of -0.05 to 0.4 m" in done.stderr
    assert not (tmp_path / "runs").exists()
