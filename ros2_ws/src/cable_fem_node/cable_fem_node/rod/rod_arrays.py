"""Arrays that the rod's kernels share: tabulated axial response, and scratch of one step."""

from __future__ import annotations

from typing import NamedTuple

from cable_fem_node.dynamics.points import FloatArray
from winding_core.material_law import TABLE_HIGH, TABLE_INTERVALS, TABLE_LOW, MaterialLaw


class AxialResponse(NamedTuple):
    """Tabulated axial response of a section."""

    table: FloatArray  # see `MaterialLaw.table`
    low: float  # stretch at the table's begin
    per_spacing: float  # intervals per unit of stretch
    area: float  # that carries tension [m^2]


class Work(NamedTuple):
    """Scratch of one step; column i is node i or the element from node i on."""

    tangent: FloatArray  # (3, capacity)
    inverse: FloatArray  # (capacity,) inverse lengths [1/m]
    tension: FloatArray  # (capacity,) [N]
    cosine: FloatArray  # (capacity,) of the turning angles
    slope: FloatArray  # (capacity,) dE/dcosine [J]
    force: FloatArray  # (3, capacity) what each element passes on [N]
    net: FloatArray  # (3, capacity) on each node [N]
    couple: FloatArray  # (capacity,) about the cable's axis [N m]


def axial_response(law: MaterialLaw, area: float) -> AxialResponse:
    """Tabulate a law for a section that carries tension on an area [m^2]."""
    spacing = TABLE_INTERVALS / (TABLE_HIGH - TABLE_LOW)
    return AxialResponse(law.table(), TABLE_LOW, spacing, area)
