"""Runs of real processes over DDS: as typed, of another material, repeated, and with slow nodes."""

import json
import os
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recordings import recorded

import cable_winding as cw
from correction_node.models.own_runs import load_own_runs
from processes import in_namespace
from winding_cli.offline.recorded_run import recorded_numbers
from winding_core.cable.cases import paper_case
from winding_core.helix import curve_length
from winding_core.machine.axes import MachineAxes
from winding_core.machine.drive import DriveProfile
from winding_core.markers import CORRECTED_DTYPE, MARKER_DTYPE, is_wound
from winding_recorder.bags.reading import opened
from winding_ros import topics
from winding_ros.graph import CORRECTION, GRAPH, TRACKER
from winding_ros.messages.clouds import decode_cloud
from winding_ros.messages.rig import JointStateReader
from winding_ros.topic import Topic

pytestmark = pytest.mark.processes
# Six markers within the 60 mm that three seconds lay.
TYPED = {
    "case": 4,
    "marker_spacing_mm": 10,
    "markers": 6,
    "young_mpa": 4,
    "law": "neo_hookean",
    "friction": 0.2,
    "duration_s": 3,
}
NAMESPACE = "slowed"
# Seconds that a message of a topic takes longer; frames come every 50 ms at a tenth of real time.
SLOW = {TRACKER.name: ("camera/image_raw", 0.025), CORRECTION.name: ("fem/markers", 0.04)}
# It tells of processes and wall time as well. An identification does so too, when a marker has
# landed: later than these runs end.
OF_THE_WALL_CLOCK = "/diagnostics"


@pytest.fixture(scope="module")
def numbers(recorded_run: Any) -> dict[str, Any]:
    return json.loads(recorded_run.json.read_text(encoding="utf-8"))


def test_run_ends_well_and_shows_its_table(recorded_run: Any) -> None:
    for word in ("original", "FEM", "tracked", "corrected", "published", "P4"):
        assert word in recorded_run.finished.stdout


def test_nothing_is_lost(recorded_run: Any, numbers: dict[str, Any]) -> None:
    assert numbers["frames"] == int(recorded_run.duration * 200) + 1
    assert numbers["joint_states"] == int(recorded_run.duration * 1000) + 1
    assert (numbers["frames_lost"], numbers["joint_states_lost"]) == (0, 0)


def test_numbers_have_the_promised_keys(numbers: dict[str, Any]) -> None:
    # Whether a material is identified before the run ends depends on the computer.
    assert set(numbers) - {"material"} == {
        "case", "ended", "markers", "frames", "frames_lost", "joint_states", "joint_states_lost",
        "wall_s", "sim_s", "identity", "error_verdict", "outcome",
    }  # fmt: skip
    assert [marker["id"] for marker in numbers["markers"]] == [1, 2, 3, 4]
    assert set(numbers["markers"][0]) == {
        "id", "original_m", "s_fem_m", "s_tracked_m", "h", "s_corrected_m", "s_published_m",
        "error_fem_pct", "error_corrected_pct", "h_held_out", "error_held_out_pct",
        "theta_tracked_rad", "z_tracked_m", "sigma_theta_rad", "sigma_z_m",
    }  # fmt: skip


def clouds(recorded_run: Any, topic: Topic, dtype: np.dtype) -> list[tuple[float, np.ndarray]]:
    """Return stamps [s] and records of a recorded cloud, in order."""
    return [decode_cloud(data, dtype) for data in recorded(recorded_run.bag, f"/{topic.name}")]


def test_wound_marker_is_tracked_to_one_percent_and_no_other_is_invented(
    recorded_run: Any, numbers: dict[str, Any]
) -> None:
    first, *later = numbers["markers"]
    assert first["s_tracked_m"] == pytest.approx(first["s_published_m"], rel=0.01)
    place = (first["theta_tracked_rad"], first["z_tracked_m"])
    assert curve_length(paper_case(4).centreline_radius, *place) == first["s_tracked_m"]
    assert (first["sigma_theta_rad"], first["sigma_z_m"]) > (0.0, 0.0)
    assert [(marker["s_fem_m"], marker["s_tracked_m"]) for marker in later] == [(None, None)] * 3
    tracked = clouds(recorded_run, topics.TRACKED_MARKERS, MARKER_DTYPE)
    assert len(tracked) == numbers["frames"]
    assert not any(is_wound(markers[markers["id"] >= 2]).any() for _, markers in tracked)


def test_recordings_are_learned_from_like_runs(recorded_run: Any, tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).symlink_to(recorded_run.bag)
    (tmp_path / "c.mcap").write_bytes(b"no recording")
    with pytest.raises(ValueError, match="has 1 of 3 runs to learn from") as refusal:
        load_own_runs(tmp_path, recorded_numbers)
    assert "run b measures exactly what run a does" in str(refusal.value)
    assert "run c.mcap has no record to learn from" in str(refusal.value)


def test_correction_is_the_weight_times_the_prediction(recorded_run: Any) -> None:
    fem = dict(clouds(recorded_run, topics.FEM_MARKERS, MARKER_DTYPE))
    corrected = clouds(recorded_run, topics.CORRECTED_MARKERS, CORRECTED_DTYPE)
    assert len(corrected) == len(fem) > 0
    for t, markers in corrected:
        np.testing.assert_array_equal(markers["s_fem"], fem[t][is_wound(fem[t])]["s"])
        np.testing.assert_allclose(markers["s"], markers["h"] * markers["s_fem"], rtol=1e-12)
        assert (markers["s_low"] <= markers["s"]).all()
        assert (markers["s"] <= markers["s_high"]).all()


def test_whole_run_is_predicted_at_activation(recorded_run: Any) -> None:
    ((t, markers),) = clouds(recorded_run, topics.FEM_PREDICTION, MARKER_DTYPE)
    assert t == 0.0
    # In 5 s the cylinder turns 7.83 rad: P1 is wound, the others are not.
    np.testing.assert_array_equal(is_wound(markers), [True, True, False, False, False])


def test_machine_follows_the_drive_profile(recorded_run: Any) -> None:
    *_, data = recorded(recorded_run.bag, "rig/joint_states")
    t, reading = JointStateReader(MachineAxes())(data)
    angle, guide = DriveProfile().positions(t)
    # The bound that the machine's own test measures.
    assert reading.cylinder_angle == pytest.approx(angle, abs=0.01)
    assert reading.carriage_position == pytest.approx(guide, abs=1e-4)


def test_report_is_one_offline_page(recorded_run: Any) -> None:
    page = recorded_run.report / "index.html"
    text = page.read_text(encoding="utf-8")
    assert [path.name for path in recorded_run.report.iterdir()] == ["index.html"]
    assert 'src="http' not in text
    assert 'href="http' not in text


def test_two_graphs_at_once_in_two_namespaces(command: Any, tmp_path: Path) -> None:
    def run(namespace: str) -> Any:
        return command(
            "run", "--case", 4, "--speed", 0, "--duration-s", 1.0, "--namespace", namespace,
            "--json", tmp_path / f"{namespace}.json",
            cwd=tmp_path,
        )  # fmt: skip

    with ThreadPoolExecutor(2) as pool:
        runs = list(pool.map(run, ("left", "right")))
    for finished in runs:
        assert finished.returncode == 0, finished.stderr
    for namespace in ("left", "right"):
        lost = json.loads((tmp_path / f"{namespace}.json").read_text(encoding="utf-8"))
        assert (lost["frames_lost"], lost["joint_states_lost"]) == (0, 0)


def typed(options: Mapping[str, object]) -> list[object]:
    """Return options as they are typed."""
    return [word for key, v in options.items() for word in (f"--{key}".replace("_", "-"), v)]


@pytest.mark.slow
def test_solid_winds_in_the_graph_as_offline_beside_the_rod(command: Any, tmp_path: Path) -> None:
    mesh = {"segment_mm": 20, "mass_scaling": 2000}
    options = {"case": 4, "marker_spacing_mm": 15, "duration_s": 3, "element": "solid", **mesh}
    done = command("run", *typed(options), "--speed", 0, "--output", "run", cwd=tmp_path, code=0)
    assert "rod ahead" in done.stdout
    record = json.loads((tmp_path / "run" / "run.json").read_text(encoding="utf-8"))
    assert (record["frames_lost"], record["joint_states_lost"]) == (0, 0)
    assert record["identity"]["condition"]["element"]["value"] == "solid"
    condition = cw.Condition(case=4, marker_spacing=0.015, duration=3.0)
    solid = cw.predict(condition, element="solid", segment_length=0.02, mass_scaling=2000.0)
    rows = record["markers"]
    # Encoders and load cell are noisy: the rod's lengths differ by 2.3e-4 for that.
    assert [row["s_fem_m"] for row in rows] == pytest.approx(solid.markers.s[1:].tolist(), rel=1e-3)
    rod = cw.predict(condition).markers.s[1:].tolist()
    assert [row["s_rod_m"] for row in rows] == pytest.approx(rod, rel=1e-12)
    # Bent by so much the solid is longer than the rod: both are not one number twice.
    assert min(row["s_fem_m"] / row["s_rod_m"] for row in rows) > 1.01


def test_another_material_is_tracked_and_corrected(command: Any, tmp_path: Path) -> None:
    command(
        "run", *typed(TYPED), "--speed", 0, "--bag", "bag", "--output", "run", cwd=tmp_path, code=0
    )
    record = json.loads((tmp_path / "run" / "run.json").read_text(encoding="utf-8"))
    assert record["case"] == 0
    rows = record["markers"]
    assert [row["id"] for row in rows] == [1, 2, 3, 4, 5, 6]
    # The lay has hidden properties; half the dead weight moves a length by 4 % at 4 MPa.
    assert [row["s_tracked_m"] for row in rows] == pytest.approx(
        [row["s_fem_m"] for row in rows], rel=0.05
    )
    assert None not in [row["s_corrected_m"] for row in rows]
    info = command("bag", "info", "bag", cwd=tmp_path).stdout
    for name, value in (("young_mpa", 4.0), ("markers", 6), ("law", "neo_hookean")):
        assert f"{name} {value}" in " ".join(info.split())


@pytest.fixture
def nodes() -> Iterator[list[subprocess.Popen[bytes]]]:
    started = []
    for spec in GRAPH:
        command = ["-m", spec.package]
        if spec.name in SLOW:
            topic, seconds = SLOW[spec.name]
            slowed = Path(__file__).with_name("slowed_node.py")
            command = [str(slowed), spec.package, topic, str(seconds)]
        started.append(
            subprocess.Popen(
                [
                    *(sys.executable, *command, *in_namespace(NAMESPACE)),
                    *("-r", f"/clock:=/{NAMESPACE}/clock"),
                ],
                env={**os.environ, "OMP_NUM_THREADS": "1"},
            )
        )
    yield started
    for process in started:
        process.kill()
        process.wait()


@pytest.mark.campaign
def test_slow_nodes_are_blamed_on_their_own_hops(nodes: Any, tmp_path: Path, command: Any) -> None:
    command(
        *("run", "--attach", "--namespace", NAMESPACE, "--case", 4, "--duration-s", 1),
        *("--speed", 0.1, "--output", "run", "--trace", "trace.json"),
        cwd=tmp_path,
        code=0,
    )
    trace = json.loads((tmp_path / "run" / "run.json").read_text())["trace"]
    assert trace["lengths"] == 51
    camera = {(cost["station"], cost["hop"]): cost for cost in trace["camera"]}
    whole = camera.pop((None, "whole"))
    # Each hop begins where the one before it ends, so that only rounding is left.
    assert sum(cost["share"] for cost in camera.values()) == pytest.approx(whole["share"], rel=1e-9)
    slow = {("tracker", "measure"): 0.025, ("correction", "compute"): 0.04}
    for hop, seconds in slow.items():
        assert camera[hop]["median_s"] >= seconds
    # Waiting aside: predictions come every 200 ms, and a slow reader makes queues.
    work = {
        hop: cost
        for hop, cost in camera.items()
        if hop[1] not in ("wait for prediction", "wait for encoder", "queue")
    }
    blamed = sorted(work, key=lambda hop: work[hop]["median_s"])[-2:]
    assert set(blamed) == set(slow)
    events = json.loads((tmp_path / "trace.json").read_text())["traceEvents"]
    assert sum(event["ph"] == "X" for event in events) > 51
    assert "Where a corrected length" in (tmp_path / "run" / "report" / "index.html").read_text()


def by_topic(bag: Path) -> dict[str, list[bytes]]:
    """Return the messages by topic; their bag times are arrivals, which no two runs share."""
    messages = defaultdict(list)
    with opened(bag) as reader:
        for link, _, data in reader.messages():
            messages[link.topic].append(bytes(data))
    return messages


@pytest.mark.slow
def test_equal_runs_record_equal_bytes(tmp_path: Path, command: Callable[..., Any]) -> None:
    for name in ("one", "other"):
        command(
            *("run", "--case", 4, "--duration-s", 3, "--speed", 0),
            *("--bag", tmp_path / name, "--output", tmp_path / f"{name}-run"),
            cwd=tmp_path,
            code=0,
        )
    one, other = by_topic(tmp_path / "one"), by_topic(tmp_path / "other")
    counts = [
        {topic: len(messages) for topic, messages in bag.items() if topic != OF_THE_WALL_CLOCK}
        for bag in (one, other)
    ]
    assert counts[0] == counts[1]
    differing = [topic for topic in one if one[topic] != other[topic]]
    assert differing in ([], [OF_THE_WALL_CLOCK])
    assert len(one) > 10
