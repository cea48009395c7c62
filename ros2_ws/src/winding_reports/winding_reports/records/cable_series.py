"""The cable of a run over time, as files: pictures for ParaView, a table for everything else."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol, TextIO
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

CableNodes = NDArray[np.void]

# Columns of the table, with their units, and the fields that they hold.
COLUMNS = {
    "s_m": "s",
    "x_m": "x",
    "y_m": "y",
    "z_m": "z",
    "tension_n": "tension",
    "strain": "strain",
    "twist_rad_m": "twist",
    "roll_rad": "roll",
}
_POINT_DATA = ("s", "tension", "strain", "twist", "roll")


class CableFile(Protocol):
    """Takes the cable at one time after another."""

    def add(self, t: float, cable: CableNodes) -> None:
        """Add the cable at a time [s], records of NODE_DTYPE from P0 to the guide."""


class CableSampler:
    """Gives files the cable of a run at evenly spread times.

    Args:
        files: What it is given to.
        times: All times of the run [s], ascending.
        pictures: How many of them, the first and the last included; all if there are fewer.

    Raises:
        ValueError: It is less than two.
    """

    def __init__(self, files: list[CableFile], times: NDArray[np.float64], pictures: int) -> None:
        if pictures < 2:
            raise ValueError(f"pictures must be at least 2, got {pictures}")
        count = min(pictures, times.size)
        chosen = np.round(np.linspace(0, times.size - 1, count)).astype(int)
        self._wanted = times[chosen].tolist()
        self._files = files

    def look(self, model: Any) -> None:
        """Take the cable if the rod stands at a chosen time."""
        if self._wanted and model.time >= self._wanted[0]:
            cable = model.cable()
            for file in self._files:
                file.add(self._wanted[0], cable)
            del self._wanted[0]


class CableTable:
    """A row for every node at every time, in a text file that is open for writing."""

    def __init__(self, target: TextIO) -> None:
        self._write: Callable[[list[Any]], Any] = csv.writer(target, lineterminator="\n").writerow
        self._write(["t_s", "node", *COLUMNS])

    def add(self, t: float, cable: CableNodes) -> None:
        """Add a row for every node; see CableFile."""
        columns = [cable[field].tolist() for field in COLUMNS.values()]
        for node, values in enumerate(zip(*columns, strict=True)):
            # Ten digits: nanometres of a cable of metres.
            self._write([f"{t:.10g}", node, *(f"{value:.10g}" for value in values)])


class VtkSeries:
    """A VTK file of each time, and the collection that ParaView opens as one series.

    Points carry arc length s [m], tension [N], strain, twist [rad/m] and roll [rad].
    """

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self._times: list[float] = []

    def add(self, t: float, cable: CableNodes) -> None:
        """Write the file of a time; see CableFile."""
        # Loaded only where it is wanted: it takes a third of a second.
        import meshio  # noqa: PLC0415

        points = np.stack([cable[name] for name in ("x", "y", "z")], axis=1)
        ends = np.arange(cable.size)
        mesh = meshio.Mesh(
            points,
            [("line", np.stack([ends[:-1], ends[1:]], axis=1))],
            point_data={name: np.ascontiguousarray(cable[name]) for name in _POINT_DATA},
        )
        mesh.write(self._folder / self._name(len(self._times)), file_format="vtu")
        self._times.append(t)

    def write_collection(self, file: Path, folder: str) -> None:
        """Write the .pvd file; the folder is that of the series as seen from there."""
        root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
        collection = ElementTree.SubElement(root, "Collection")
        for i, t in enumerate(self._times):
            place = f"{folder}/{self._name(i)}"
            ElementTree.SubElement(
                collection, "DataSet", timestep=f"{t:.10g}", part="0", file=place
            )
        ElementTree.indent(root)
        ElementTree.ElementTree(root).write(file, encoding="utf-8", xml_declaration=True)

    def _name(self, i: int) -> str:
        return f"cable_{i:05d}.vtu"
