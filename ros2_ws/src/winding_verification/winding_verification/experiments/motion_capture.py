"""Cables that two grippers move, as motion capture saw them: the files of DEFORM.

A cable is a folder that holds the folders `train` and `eval`; in them is one pickle per run: nested
lists (frames, 3, markers) of coordinates [m], z up, 100 frames a second. The first two and the last
two markers move with the grippers.
"""

import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cable_fem_node.dynamics.state import FloatArray
from winding_verification.experiments.scenario import ExternalFileError

FRAME_TIME = 0.01  # [s]
# Two frames that start a run and one to predict; two gripped markers at each end and one free.
_LEAST_FRAMES, _LEAST_MARKERS = 3, 5
# Protocol 4 names numpy's scalars like this; other classes are not made from a file.
_NUMBERS = {
    ("numpy.core.multiarray", "scalar"),
    ("numpy._core.multiarray", "scalar"),
    ("numpy", "dtype"),
}


@dataclass(frozen=True, kw_only=True)
class CapturedCable:
    """The runs of one cable."""

    name: str  # Of its folder
    train: tuple[FloatArray, ...]  # Runs to fit on, each (frames, markers, 3) [m]
    held_out: tuple[FloatArray, ...]  # Runs of the evaluation, the same
    # Least evaluation loss in the files beside it [m]; None if there is none.
    published: float | None


class _Numbers(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if (module, name) not in _NUMBERS:
            raise pickle.UnpicklingError(f"it names {module}.{name}")
        return super().find_class(module, name)


def cable_folders(folder: Path) -> list[Path]:
    """Return the cables' folders at or below a folder."""
    parts = sorted(folder.rglob("eval")) + ([folder / "eval"] if folder.name != "eval" else [])
    found = {part.parent for part in parts if next(part.glob("*.pkl"), None) is not None}
    return sorted(found, key=lambda cable: cable.name)


def read_cable(folder: Path) -> CapturedCable:
    """Return the runs of a cable.

    Raises:
        ExternalFileError: A split is missing, or a file is no run; names the file and the cause.
    """
    splits = {}
    for split in ("train", "eval"):
        files = sorted((folder / split).glob("*.pkl"), key=lambda file: (len(file.name), file.name))
        if not files:
            raise ExternalFileError(
                f"{folder / split} holds no run (*.pkl); a cable of DEFORM has train and eval"
            )
        splits[split] = tuple(read_run(file) for file in files)
    counts = {run.shape[1] for split in splits.values() for run in split}
    if len(counts) > 1:
        raise ExternalFileError(
            f"the runs in {folder} have {sorted(counts)} markers, not one number"
        )
    losses = folder.parent.parent / "loss_record" / f"eval_loss_{folder.name}.pkl"
    return CapturedCable(
        name=folder.name,
        train=splits["train"],
        held_out=splits["eval"],
        published=min(_array(losses, 1).tolist(), default=None) if losses.is_file() else None,
    )


def read_run(file: Path) -> FloatArray:
    """Return a run (frames, markers, 3) [m].

    Raises:
        ExternalFileError: The file is not one.
    """
    run = np.swapaxes(_array(file, 3), 1, 2)
    frames, markers, axes = run.shape
    if axes != 3 or frames < _LEAST_FRAMES or markers < _LEAST_MARKERS:
        raise ExternalFileError(
            f"{file} is no run of DEFORM: it must have shape (frames, 3, markers) with at least "
            f"{_LEAST_FRAMES} frames and {_LEAST_MARKERS} markers, got {(frames, axes, markers)}"
        )
    if not np.linalg.norm(np.diff(run, axis=1), axis=2).all():
        raise ExternalFileError(f"{file} is no run of DEFORM: two neighbouring markers coincide")
    return np.ascontiguousarray(run)


def _array(file: Path, axes: int) -> FloatArray:
    try:
        with file.open("rb") as stream:
            array = np.array(_Numbers(stream).load(), dtype=float)
    # A damaged pickle may raise anything.
    except Exception as error:
        raise ExternalFileError(f"{file} is no file of DEFORM: {error}") from error
    if array.ndim != axes or not np.isfinite(array).all():
        raise ExternalFileError(
            f"{file} is no file of DEFORM: it must hold finite numbers in {axes} levels of lists, "
            f"got shape {array.shape}"
        )
    return array
