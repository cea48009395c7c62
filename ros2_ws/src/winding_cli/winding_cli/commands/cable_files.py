"""The files that a winding's cable is written to while it is wound."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cable_fem_node.dynamics.points import FloatArray
    from cable_fem_node.winding.prediction import Look

from winding_cli.commands.output_path import check_output_folder, staged


@contextmanager
def cable_files(
    csv_file: Path | None, vtk_file: Path | None, times: FloatArray, pictures: int
) -> Iterator[Look]:
    """Yield what looks at the model of a rod; the files are there when the body has ended.

    Args:
        csv_file: Table to write; None for none.
        vtk_file: ParaView's collection to write, with a folder of its name beside it; None for
            none.
        times: All times of the run [s], ascending.
        pictures: How many of them are told.
    """
    if csv_file is None and vtk_file is None:
        yield lambda _model: None
        return
    from winding_reports.records.cable_series import CableFile, CableSampler, CableTable, VtkSeries

    files: list[CableFile] = []
    with ExitStack() as stack:
        if csv_file is not None:
            table = stack.enter_context(staged(csv_file))
            target = stack.enter_context(table.open("w", encoding="utf-8", newline=""))
            files.append(CableTable(target))
        series: VtkSeries | None = None
        if vtk_file is not None:
            folder = vtk_file.with_suffix("")
            check_output_folder(folder, "--vtk")
            collection = stack.enter_context(staged(vtk_file))
            series = VtkSeries(stack.enter_context(staged(folder)))
            files.append(series)
        yield CableSampler(files, times, pictures).look
        if series is not None:
            series.write_collection(collection, folder.name)
