"""Read what a run leaves behind: its results and its recording."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from winding_recorder.bags.reading import opened
from winding_recorder.bags.tables import topic_rows

FloatArray = NDArray[np.float64]

_COLUMNS = ("original_m", "s_fem_m", "s_tracked_m", "s_corrected_m", "s_published_m", "h")


@dataclass(frozen=True, kw_only=True)
class Run:
    """Lengths from P0 at the end of a run; NaN where there is no such number.

    Attributes:
        id: Number n of Pn, shape (n,).
        original: Undeformed length [m], shape (n,).
        s_fem: Predicted [m], shape (n,).
        s_tracked: Measured by the camera [m], shape (n,).
        s_corrected: Prediction times the correction factor [m], shape (n,).
        h: Correction factor, shape (n,).
        s_published: Measured in the paper's experiment [m], shape (n,).
        record: The whole of run.json, of the schema `run` of docs/schemas.md.
    """

    id: NDArray[np.int64]
    original: FloatArray
    s_fem: FloatArray
    s_tracked: FloatArray
    s_corrected: FloatArray
    h: FloatArray
    s_published: FloatArray
    record: Mapping[str, Any]


def read_run(folder: str | PathLike[str]) -> Run:
    """Read the results of a run.

    Args:
        folder: Output folder of `winding run` or `winding bag report`, or its run.json.

    Raises:
        FileNotFoundError: There is no run.json.
        ValueError: The file is not the record of a run.
    """
    path = Path(folder)
    path = path / "run.json" if path.is_dir() else path
    record = json.loads(path.read_text(encoding="utf-8"))
    try:
        rows = record["markers"]
        columns = {
            key.removesuffix("_m"): np.array([row[key] for row in rows], dtype=np.float64)
            for key in _COLUMNS
        }
        return Run(id=np.array([row["id"] for row in rows], dtype=int), record=record, **columns)
    except (KeyError, TypeError) as error:
        raise ValueError(f"{path} is not the record of a run: {error!r}") from error


def list_topics(bag: str | PathLike[str]) -> dict[str, str]:
    """Return the message type of each topic of a recording, by the topic's full name.

    Args:
        bag: Folder or storage file of the recording.

    Raises:
        BagError: The recording cannot be read.
    """
    with opened(Path(bag)) as reader:
        return {link.topic: link.msgtype for link in reader.connections}


def read_bag(bag: str | PathLike[str], topic: str) -> dict[str, NDArray[Any]]:
    """Read one topic of a recording as columns, ready for `pandas.DataFrame`.

    A point cloud has one row per point, with `id`, `theta`, `z`, `s` and `flags` for markers; any
    other message has one row. Column `t` is the stamp [s]. Pixels are left out.

    Args:
        bag: Folder or storage file of the recording.
        topic: Full name, or its end, such as ``tracker/markers``.

    Returns:
        Columns of equal length, shape (rows,), by name.

    Raises:
        BagError: The recording cannot be read, or does not hold the topic exactly once.
    """
    rows = [row for message in topic_rows(Path(bag), topic) for row in message]
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: np.array([row.get(name) for row in rows]) for name in names}
