"""Cables between grippers: DEFORM's format and loss, prediction, fit, the command.

The runs are made here with this rod: nothing of that data set is kept.
"""

import json
import os
import pickle
from pathlib import Path

import numpy as np
import pytest
from in_process import winding

from cable_fem_node.dynamics.state import FloatArray
from winding_verification.experiments import held_cable_comparison as held_cable_fit
from winding_verification.experiments.held_cable_comparison import (
    HeldCable,
    loss,
    predict,
    shape_of_its_own,
)
from winding_verification.experiments.motion_capture import read_cable, read_run
from winding_verification.experiments.scenario import ExternalFileError
from winding_verification.rod.rod import Rod, RodSection
from winding_verification.solver.rods import line

CABLE = HeldCable(bending=0.05, viscosity=0.1, drag=0.0, natural=(0.0, 0.0), own=0.0)
GAPS = np.array([0.02, 0.08, 0.08, 0.08, 0.08, 0.08, 0.02])


def hanging(cable: HeldCable = CABLE, frames: int = 150) -> FloatArray:
    """Return markers (8, 3) [m] of a cable that has come to rest between clamps, ends downwards."""
    arc = np.concatenate([[0.0], np.cumsum(GAPS)]) - 0.5 * GAPS.sum()
    turned = np.pi * arc / GAPS.sum()
    radius = GAPS.sum() / np.pi
    arch = radius * np.stack([np.sin(turned), np.zeros(8), -np.cos(turned)], axis=1)
    return predict(np.tile(arch, (frames, 1, 1)), GAPS, cable)[-1]


def moved_run(rest: FloatArray, frames: int, swing: float, cable: HeldCable = CABLE) -> FloatArray:
    """Return a run (frames, 8, 3): both ends sway across the cable by a swing [m]."""
    way = swing * np.sin(0.06 * np.arange(frames)) ** 2
    run = np.tile(rest, (frames, 1, 1))
    run[:, :, 1] += way[:, None]
    run[:, -2:, 0] += 0.5 * way[:, None]
    run[:2] = rest
    return predict(run, GAPS, cable)


def write_run(file: Path, run: FloatArray) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(pickle.dumps(np.swapaxes(run, 1, 2).tolist(), protocol=4))


def write_losses(folder: Path, name: str, losses: list[float]) -> None:
    """Write what training recorded, as numpy's scalars, as the data set has it."""
    file = folder / "loss_record" / f"eval_loss_{name}.pkl"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(pickle.dumps([np.float64(loss) for loss in losses], protocol=4))


@pytest.fixture(scope="module")
def rest() -> np.ndarray:
    return hanging()


def test_run_is_read_marker_by_marker(tmp_path: Path) -> None:
    run = np.random.default_rng(3).standard_normal((4, 6, 3))
    write_run(tmp_path / "1.pkl", run)
    assert read_run(tmp_path / "1.pkl") == pytest.approx(run, abs=0.0)


def test_cable_has_the_least_loss_that_its_training_recorded(tmp_path: Path) -> None:
    run = np.random.default_rng(4).standard_normal((4, 6, 3))
    for split in ("train", "eval"):
        write_run(tmp_path / "data_set" / "DLO7" / split / "1.pkl", run)
    write_losses(tmp_path, "DLO7", [0.03, 0.011, 0.012])
    assert read_cable(tmp_path / "data_set" / "DLO7").published == 0.011


class _Command:
    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.system, ("exit 3",)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (pickle.dumps(_Command()), "it names posix.system"),
        (pickle.dumps([[[1.0, 2.0]] * 3] * 4), "at least 3 frames and 5 markers, got (4, 3, 2)"),
        (pickle.dumps([[[np.nan] * 6] * 3] * 4), "it must hold finite numbers"),
        (pickle.dumps([[[1.0] * 6] * 3] * 4), "two neighbouring markers coincide"),
        (b"no pickle", "is no file of DEFORM"),
    ],
)
def test_file_that_is_no_run_is_refused(tmp_path: Path, content: bytes, sentence: str) -> None:
    file = tmp_path / "1.pkl"
    file.write_bytes(content)
    with pytest.raises(ExternalFileError) as caught:
        read_run(file)
    assert sentence in str(caught.value)
    assert str(file) in str(caught.value)


def test_loss_is_the_mean_of_absolute_coordinates_behind_the_first_two_frames() -> None:
    run = np.zeros((6, 8, 3))
    found = run.copy()
    found[2:, 3, 1] = -0.048
    found[:2] = 7.0
    # One of 24 coordinates is off; the gripped markers count with nothing.
    assert loss(found, run) == pytest.approx(0.002)


def test_prediction_knows_two_frames_of_the_free_markers(rest: np.ndarray) -> None:
    run = moved_run(rest, 20, 0.05)
    blind = run.copy()
    blind[2:, 2:-2] = np.nan
    found = predict(blind, GAPS, CABLE)
    assert found[2:, 2:-2] == pytest.approx(run[2:, 2:-2], abs=1.0e-12)


def test_swaying_grippers_take_the_cable_along(rest: np.ndarray) -> None:
    run = moved_run(rest, 100, 0.05)
    # The cable is carried, and lags: it is not where the grippers' way alone would put it.
    assert np.abs(run[:, 3:-3] - rest[3:-3]).max() > 0.03
    length = np.linalg.norm(np.diff(run, axis=1), axis=2)[2:, 1:-1]
    assert length == pytest.approx(np.tile(GAPS[1:-1], (98, 1)), rel=2.0e-3)


@pytest.mark.slow
def test_cable_is_found_from_own_runs(rest: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(held_cable_fit, "ROUNDS", 5)
    runs = [moved_run(rest, 70, 0.15)]
    gaps = held_cable_fit.usual_gaps(runs)
    cable = held_cable_fit.fit(runs, gaps)
    # Five rounds of a search whose slopes are secants.
    assert cable.bending == pytest.approx(CABLE.bending, rel=0.1)
    other = moved_run(rest, 70, -0.1)
    # A millimetre is below what any cable of the data set can be predicted to.
    assert loss(predict(other, gaps, cable), other) < 1.0e-3


def test_run_whose_gripped_markers_are_exchanged_is_not_fitted_on(rest: np.ndarray) -> None:
    run = moved_run(rest, 5, 0.05)
    run[:, [-1, -2]] = run[:, [-2, -1]]
    with pytest.raises(ExternalFileError, match="in every training run two gripped markers"):
        held_cable_fit.fit([run], GAPS)


def test_natural_curvature_bends_about_the_y_axis(rest: np.ndarray) -> None:
    cable = held_cable_fit.HeldCable(
        bending=0.05, viscosity=0.1, drag=0.0, natural=(2.0, 0.0), own=0.0
    )
    rod = held_cable_fit._placed(np.stack([rest, rest]), GAPS, cable)
    first, second = rod.directors()
    binormal = rod.natural[0] * second - rod.natural[1] * first
    # The cable lies in the plane y = 0.
    assert binormal[1] == pytest.approx(2.0 * rod.voronoi, rel=1.0e-6)
    assert np.abs(binormal[[0, 2]]).max() < 1.0e-9


def test_bend_that_no_moment_makes_is_the_rod_s_own() -> None:
    nodes = line(0.5, 10)
    nodes[5:, 1] += 0.2 * (nodes[5:, 0] - 0.25)
    rod = Rod(nodes, RodSection(diameter=6.0e-3), twist=True)
    rod.clamp("start")
    rod.clamp("end")
    own = np.linalg.norm(shape_of_its_own(rod), axis=0)
    # The bend of 0.2 is in one node; what moments take of it varies smoothly along the rod.
    assert own.argmax() == 5
    assert own[5] > 0.07
    assert np.delete(own, 5).max() < 0.06


def test_moment_of_an_end_load_leaves_no_shape_of_its_own() -> None:
    nodes = line(0.5, 20)
    x = nodes[:, 0]
    nodes[:, 1] = 0.02 * x**2 * (1.5 - x)
    rod = Rod(nodes, RodSection(diameter=6.0e-3), twist=True)
    rod.clamp("start", (1.0, 0.0, 0.0))
    rod.clamp("end")
    own = shape_of_its_own(rod)
    # The end's clamp stands at the last element's angle: its half element is straight.
    assert np.abs(own[:, 1:-1]).max() < 0.05 * np.abs(rod.curvatures()[:2]).max()


@pytest.mark.campaign
def test_command_fits_predicts_and_compares(tmp_path: Path, rest: np.ndarray) -> None:
    cable = tmp_path / "data_set" / "DLO7"
    for number, swing in enumerate((0.06, 0.12)):
        write_run(cable / "train" / f"{number}.pkl", moved_run(rest, 60, swing))
    write_run(cable / "eval" / "9.pkl", moved_run(rest, 60, -0.1))
    write_losses(tmp_path, "DLO7", [0.02, 0.01])
    table = tmp_path / "rows.json"
    words = ["verify", "deform", "--external", str(tmp_path), "--json", str(table)]
    done = winding(tmp_path, *words, code=0)
    error, time, share = json.loads(table.read_text())
    assert error["published"] == {"DEFORM": 0.01}
    assert error["computed"] < 1.0e-3
    assert error["bar"] == pytest.approx(0.015)
    assert time["bar"] is None
    assert share["computed"] == 1.0
    assert "2 of 2 quantities within their bar" in done.output


@pytest.mark.parametrize(
    ("split", "sentence"),
    [
        ("eval", "holds no run (*.pkl); a cable of DEFORM has train and eval"),
        ("train", "holds no runs of DEFORM"),
    ],
)
def test_cable_without_one_split_is_refused(tmp_path: Path, split: str, sentence: str) -> None:
    run = np.random.default_rng(4).standard_normal((4, 6, 3))
    write_run(tmp_path / "DLO7" / split / "1.pkl", run)
    done = winding(tmp_path, "verify", "deform", "--external", tmp_path, code=2)
    assert sentence in " ".join(done.output.split())
