"""Controller and brake in runs of real processes: where markers land, and when nodes die."""

import json
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recordings import recorded

from lay_control_node.ros.parameters import LayControlParameters
from processes import COMMAND, child_of, until
from winding_core.lay.records import LAY_CONTROL_DTYPE
from winding_core.markers import MARKER_DTYPE, MarkerFlag
from winding_ros import topics
from winding_ros.messages.clouds import decode_cloud
from winding_ros.messages.rig import JointStateReader
from winding_ros.topic import Topic

pytestmark = [pytest.mark.campaign, pytest.mark.processes, pytest.mark.timeout(1200)]

PATIENCE = 600.0
# Of the drive programme, which is what is wanted here: an even helix [m/rad].
ADVANCE = LayControlParameters().resolved().drive.advance_per_radian
# Where 0.9 of the weight lands the markers of two stiff cables if the rig is as believed [turns]:
# the middle of what the pull reaches, and `winding plan` expects P1 within 2 % of a turn there.
WANTED = {9: (1.012, 2.037, 3.068, 4.101), 11: (0.969, 1.944, 2.921, 3.899)}

# Pictures and all, in the run's folder: 700 MB for a run that goes to its end.
RECORDED = ("--bag", "bag")


@dataclass(frozen=True, kw_only=True)
class Controlled:
    """What a controlled run leaves in its folder."""

    folder: Path

    @property
    def truth(self) -> dict[str, Any]:
        return json.loads((self.folder / "truth.json").read_text(encoding="utf-8"))

    def events(self) -> list[dict[str, Any]]:
        file = self.folder / "run" / "events.jsonl"
        lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
        return [json.loads(line) for line in lines]

    def missed(self, advance: float) -> np.ndarray:
        """Return how far each landed marker lies off an even helix of an advance [m/rad], in m."""
        markers = self.truth["markers"]
        places = zip(markers["theta"], markers["z"], strict=True)
        return np.array([abs(z - advance * theta) for theta, z in places if theta])

    def messages(self, topic: Topic) -> list[bytes]:
        return recorded(self.folder / "bag", f"/{topic.name}")

    def carriage(self) -> np.ndarray:
        """Return time [s], position [m] and speed [m/s] of the carriage, shape (n, 3)."""
        read = JointStateReader(LayControlParameters())
        rows = [read(data) for data in self.messages(topics.JOINT_STATES)]
        return np.array([(t, r.carriage_position, r.feed_speed) for t, r in rows])


def arguments(folder: Path, control: str, *further: object, case: int = 4) -> list[str]:
    return [
        str(word)
        for word in (
            *("run", "--case", case, "--control", control, "--truth", folder / "truth.json"),
            *("--output", folder / "run", *further),
        )
    ]


@pytest.fixture(scope="session")
def wound(command: Callable[..., Any]) -> Callable[..., Controlled]:
    """Wind a controlled run as fast as all follow."""

    def wind(folder: Path, control: str, *further: object, case: int = 4) -> Controlled:
        words = arguments(folder, control, "--speed", 0, *further, case=case)
        command(*words, cwd=folder, patience=PATIENCE, code=0)
        return Controlled(folder=folder)

    return wind


@pytest.fixture(scope="module")
def driven(
    tmp_path_factory: pytest.TempPathFactory, wound: Callable[..., Controlled]
) -> Controlled:
    """Return a run that the controller drives until P2 has landed."""
    return wound(tmp_path_factory.mktemp("driven"), "drive", "--duration-s", 9, *RECORDED)


def test_markers_land_on_the_wanted_helix(driven: Controlled) -> None:
    errors = driven.missed(ADVANCE)
    assert errors.size >= 2
    # P1 lies in the first turn, in which the guide still gets ahead: 1.0 mm; from then on 0.5 mm.
    assert errors[0] <= 1.0e-3
    assert max(errors[1:]) <= 0.5e-3


@pytest.mark.parametrize("seed", [11, 12, 13])
@pytest.mark.parametrize("case", [1, 4, 9, 12])
def test_hidden_rigs_are_led_to_the_helix(case: int, seed: int, tmp_path: Path, wound: Any) -> None:
    run = wound(tmp_path, "drive", "--seed", seed, case=case)
    errors = run.missed(LayControlParameters(case=case).resolved().drive.advance_per_radian)
    # The bars of the offline study: P1 and P2 1.0 mm, those behind 0.5 mm.
    bars = np.array([1.0e-3, 1.0e-3, *[0.5e-3] * (errors.size - 2)])
    assert errors.size >= 3
    assert (errors < bars).all(), errors
    record = json.loads((tmp_path / "run" / "run.json").read_text(encoding="utf-8"))
    assert record["frames_lost"] == record["joint_states_lost"] == 0


def test_controller_predicts_where_the_cable_lands(driven: Controlled) -> None:
    records = np.concatenate(
        [
            decode_cloud(data, LAY_CONTROL_DTYPE)[1]
            for data in driven.messages(topics.LAY_CONTROL_STATE)
        ]
    )
    path = driven.truth["path"]
    last = records[records["theta"] < path["theta"][-1]][-1]
    truth = np.interp(last["theta"], path["theta"], path["z"])
    assert abs(last["z"] - truth) < 4.0 * last["sigma_z"] + 1.0e-4


def test_watching_commands_nothing(tmp_path: Path, wound: Callable[..., Controlled]) -> None:
    watched = wound(tmp_path, "watch", "--duration-s", 2, *RECORDED)
    assert watched.messages(topics.LAY_CONTROL_STATE)
    assert watched.messages(topics.JOINT_TARGETS) == []
    assert watched.messages(topics.TENSION_COMMAND) == []


@pytest.fixture(scope="module")
def survived(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Controlled]:
    """Return a driven run in which the tracker, the solver and the controller were killed."""
    folder = tmp_path_factory.mktemp("survived")
    run = Controlled(folder=folder)
    errors = folder / "stderr"
    with errors.open("w") as stderr:
        process = subprocess.Popen(
            [*COMMAND, *arguments(folder, "drive", *RECORDED)],
            cwd=folder,
            stdout=subprocess.DEVNULL,
            stderr=stderr,
        )

    def resumed(count: int) -> bool:
        return sum(event["what"] == "resumed" for event in run.events()) >= count

    try:
        until(lambda: " simulated, " in errors.read_text("utf-8"), PATIENCE, process)
        killed = ("marker_tracker_node", "cable_fem_node", "lay_control_node")
        for count, package in enumerate(killed, start=1):
            child_of(process, package).kill()
            until(lambda count=count: resumed(count), PATIENCE, process)
        assert process.wait(PATIENCE) == 0, errors.read_text(encoding="utf-8")
        yield run
    finally:
        if process.poll() is None:
            process.kill()
        process.wait()


def test_nodes_that_died_are_started_again_and_the_run_goes_on(survived: Controlled) -> None:
    def seen(node: str) -> list[str]:
        return [event["what"] for event in survived.events() if event["node"] == node]

    # The machine is stopped first each time; the nodes come back, and the run with them.
    assert seen(topics.RIG) == ["stopped", "standing", "resumed"] * 3
    for node in (topics.TRACKER, topics.FEM, topics.LAY_CONTROL):
        assert seen(node) == ["detected", "restarting", "restarted"]


def test_guide_makes_no_step_when_nodes_die(survived: Controlled) -> None:
    t, position, speed = survived.carriage().T
    assert np.diff(t).max() < 2.0e-3
    way = 0.5 * (speed[1:] + speed[:-1]) * np.diff(t)
    # The bound that is asked for: 0.2 mm beyond what the speed makes of the time between.
    assert np.abs(np.diff(position) - way).max() < 0.2e-3


def test_lay_is_on_the_helix_again_after_the_failures(survived: Controlled) -> None:
    path = survived.truth["path"]
    theta, z = np.array(path["theta"]), np.array(path["z"])
    last_turn = theta > theta[-1] - 2.0 * np.pi
    # The bound of an undisturbed run from P2 on.
    assert np.abs(z - ADVANCE * theta)[last_turn].max() < 0.5e-3


def test_no_marker_has_the_number_of_another_after_the_failures(survived: Controlled) -> None:
    true = np.array(survived.truth["markers"]["theta"], dtype=float)
    _, records = decode_cloud(survived.messages(topics.TRACKED_MARKERS)[-1], MARKER_DTYPE)
    known = records[(records["flags"] & MarkerFlag.NOT_WOUND) == 0]
    assert known.size >= 2
    # The next marker lies 6 rad further; the measured ones lie within 3 mrad.
    np.testing.assert_allclose(known["theta"], true[known["id"]], atol=0.05)


@pytest.mark.parametrize("seed", [31, 32])
@pytest.mark.parametrize("case", WANTED)
def test_markers_land_at_their_angles(case: int, seed: int, tmp_path: Path, command: Any) -> None:
    program, truth = tmp_path / "wanted.yaml", tmp_path / "truth.json"
    markers = ", ".join(f"{n}: {turns}" for n, turns in enumerate(WANTED[case], start=1))
    program.write_text(
        f"segments:\n- helix: {{pitch_mm: 18.055, turns: 7}}\nmarkers: {{turns: {{{markers}}}}}\n",
        encoding="utf-8",
    )
    command(
        *("run", "--case", str(case), "--law", "neo_hookean", "--control", "drive", "--brake"),
        *("--program", str(program), "--truth", str(truth), "--output", str(tmp_path / "run")),
        *("--speed", "0", "--seed", str(seed)),
        cwd=tmp_path,
        patience=600.0,
        code=0,
    )
    landed = json.loads(truth.read_text(encoding="utf-8"))["markers"]["theta"][1:5]
    missed = np.abs(np.array(landed) / (2.0 * np.pi) - WANTED[case])
    # What a cell is promised where the pull reaches: 2 % of a turn at P1, 1 % from P2 on.
    assert missed[0] < 0.02
    assert (missed[1:] < 0.01).all()
