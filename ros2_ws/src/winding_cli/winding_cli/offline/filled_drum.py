"""A filled drum as a table of its layers, and what is on it in sentences."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import accumulate
from typing import Any

from rich.console import Console

from winding_cli.terminal.console import Shown, record_table
from winding_core.units import MILLIMETRE

_LAYERS = (
    Shown("layer", "number"),
    Shown("turns", lambda row: row["last_turn"] - row["first_turn"], ".2f"),
    Shown("until turn", "last_turn", ".2f"),
    Shown("from z, mm", lambda row: row["z_m"][0], ".2f", MILLIMETRE),
    Shown("to z, mm", "last_z_m", ".2f", MILLIMETRE),
    Shown("radius, mm", "radius_m", ".2f", MILLIMETRE),
    Shown("cable, m", "length_m", ".3f"),
    Shown("in all, m", "in_all_m", ".3f"),
    Shown("pull, N", "pull_n", ".3f"),
    Shown("drum, rad/s", "cylinder_speed_rad_s", ".3f"),
)


def print_drum(console: Console, drum: Mapping[str, Any]) -> None:
    """Print what a record of `drum_record` holds."""
    layers = drum["layers"]
    rows = [
        {**row, "in_all_m": done}
        for row, done in zip(layers, accumulate(row["length_m"] for row in layers), strict=True)
    ]
    title = f"{len(rows)} {drum['winding']} layers at a pitch of {drum['pitch_m'] / MILLIMETRE:.4g}"
    console.print(record_table(_LAYERS, rows, title=f"{title} mm"))
    lines = (
        f"{drum['length_m']:.4g} m of cable in {drum['turns']:.4g} turns, "
        f"{drum['undeformed_length_m']:.4g} m before it was stretched; filled to "
        f"{drum['filled_diameter_m'] / MILLIMETRE:.4g} mm, the flanges have "
        f"{drum['flange_diameter_m'] / MILLIMETRE:.4g} mm",
        f"mass of the cable {drum['mass_kg']:.3g} kg, its moment of inertia about the axis "
        f"{drum['inertia_kg_m2']:.3g} kg m^2; the cable runs at "
        f"{drum['cable_speed_m_s'] / MILLIMETRE:.4g} mm/s on every layer",
    )
    console.print("\n".join(lines), soft_wrap=True, markup=False)
