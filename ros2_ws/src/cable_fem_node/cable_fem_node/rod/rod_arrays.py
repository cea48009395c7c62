"""Arrays that the rod's kernels share: tabulated axial response and fading, scratch of a step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cable_fem_node.dynamics.points import FloatArray
from winding_core.cable.material_law import TABLE_HIGH, TABLE_INTERVALS, TABLE_LOW, MaterialLaw
from winding_core.cable.prony import PronySeries

# Points of the law's inverse, and of the table that it is read from: strains are exact to 1e-6.
_POINTS, _FINE = 8193, 65537
_LOWEST_STRETCH = 0.5


class AxialResponse(NamedTuple):
    """Tabulated axial response of a section."""

    table: FloatArray  # see `MaterialLaw.table`
    low: float  # stretch at the table's begin
    per_spacing: float  # intervals per unit of stretch
    area: float  # that carries tension [m^2]


class Relaxation(NamedTuple):
    """How the axial force of an element fades; without terms it does not."""

    share: FloatArray  # (terms,) g
    time: FloatArray  # (terms,) tau [s]
    strain: FloatArray  # (points,) of the law, over a uniform grid of forces
    low: float  # first force [N]
    per_spacing: float  # points per force [1/N]
    high: float  # last force [N]


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


def relaxation(law: MaterialLaw, area: float, series: PronySeries) -> Relaxation:
    """Tabulate the inverse of a law for a section that carries tension on an area [m^2]."""
    stretch = np.linspace(_LOWEST_STRETCH, min(law.limit()[1], TABLE_HIGH), _FINE)
    force = area * law.nominal_stress(stretch)
    grid = np.linspace(force[0], force[-1], _POINTS)
    return Relaxation(
        share=np.array(series.shares, dtype=float),
        time=np.array(series.times, dtype=float),
        strain=np.interp(grid, force, stretch) - 1.0,
        low=float(grid[0]),
        per_spacing=(_POINTS - 1) / float(grid[-1] - grid[0]),
        high=float(grid[-1]),
    )
