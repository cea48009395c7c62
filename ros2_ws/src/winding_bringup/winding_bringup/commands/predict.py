"""`winding predict`: wind a run ahead of time, without ROS."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from winding_bringup.commands.refusal import refuse

if TYPE_CHECKING:
    from cable_fem_node.prediction import Prediction
    from cable_winding.cases import Case

MILLIMETRE = 1.0e-3
MEGAPASCAL = 1.0e6


def predict(
    *,
    case: Annotated[int | None, typer.Option(help="Row of the paper's Table 1 (1 to 12).")] = None,
    cylinder_diameter_mm: Annotated[float | None, typer.Option(help="[mm]")] = None,
    cable_diameter_mm: Annotated[float | None, typer.Option(help="Undeformed [mm].")] = None,
    tension_mpa: Annotated[
        float | None, typer.Option(help="Weight over the undeformed section [MPa].")
    ] = None,
    tension_n: Annotated[float | None, typer.Option(help="Weight on the cable's end [N].")] = None,
    young_mpa: Annotated[float | None, typer.Option(help="Young's modulus [MPa]; 2.6.")] = None,
    poisson: Annotated[float | None, typer.Option(help="Poisson's ratio; 0.47.")] = None,
    density: Annotated[float | None, typer.Option(help="[kg/m^3]; 1337.")] = None,
    friction: Annotated[float, typer.Option(help="Coulomb friction, cable on cylinder.")] = 0.1,
    guide_distance_mm: Annotated[
        float | None, typer.Option(help="Guide to cylinder axis [mm]; a tangent span of 198 mm.")
    ] = None,
    marker_spacing_mm: Annotated[
        float | None, typer.Option(help="Along the undeformed cable [mm]; the case's, or 100.")
    ] = None,
    markers: Annotated[int, typer.Option(help="Markers after P0.")] = 4,
    feed_mm_s: Annotated[float, typer.Option(help="Carriage speed after the ramp.")] = 5.0,
    omega_rad_s: Annotated[float, typer.Option(help="Cylinder speed after the ramp.")] = 1.74,
    duration_s: Annotated[float, typer.Option(help="Time to wind [s].")] = 20.0,
    segment_mm: Annotated[float, typer.Option(help="Length of an element [mm].")] = 5.0,
    law: Annotated[
        str,
        typer.Option(help="linear, hencky, hencky_cauchy, neo_hookean or mooney_rivlin."),
    ] = "linear",
    element: Annotated[str, typer.Option(help="rod or solid.")] = "rod",
    mass_scaling: Annotated[
        float | None, typer.Option(help="Factor on the density; rod 1, solid 400.")
    ] = None,
    rolling: Annotated[
        bool, typer.Option("--rolling/--no-rolling", help="Let the rod roll on the cylinder.")
    ] = False,
    json_file: Annotated[
        Path | None, typer.Option("--json", help="Also write the result to this file.")
    ] = None,
) -> None:
    """Predict where every marker ends up, how much cable is used, and how far to trust it."""
    from cable_fem_node.failure import DivergenceError, EnergyBalanceError
    from cable_fem_node.winding_config import WindingConfig
    from cable_winding.drive import DriveProfile
    from cable_winding.fleet import PAPER_FREE_LENGTH, free_length_of

    if element not in ("rod", "solid"):
        refuse(f"element must be rod or solid, got {element!r}")
    if tension_mpa is not None and tension_n is not None:
        refuse("give the tension once: --tension-mpa or --tension-n")
    try:
        condition = _condition(
            case=case,
            cylinder_diameter_mm=cylinder_diameter_mm,
            cable_diameter_mm=cable_diameter_mm,
            tension_mpa=tension_mpa,
            tension_n=tension_n,
            material={
                "young": (young_mpa, MEGAPASCAL),
                "poisson": (poisson, 1.0),
                "density": (density, 1.0),
            },
            marker_spacing_mm=marker_spacing_mm,
            markers=markers,
        )
        free_length = (
            PAPER_FREE_LENGTH
            if guide_distance_mm is None
            else free_length_of(guide_distance_mm * MILLIMETRE, condition.centreline_radius)
        )
        config = WindingConfig(
            case=condition,
            friction=friction,
            law=law,
            segment_length=segment_mm * MILLIMETRE,
            free_length=free_length,
            mass_scaling=mass_scaling or (1.0 if element == "rod" else 400.0),
            rolling=rolling,
        )
        drive = DriveProfile(angular_speed=omega_rad_s, feed_speed=feed_mm_s * MILLIMETRE)
        result = _wind(config, drive, duration_s, element)
    except (ValueError, DivergenceError, EnergyBalanceError) as error:
        refuse(error)
    _print(result, element)
    if json_file is not None:
        try:
            json_file.write_text(json.dumps(_record(result, element), indent=1) + "\n")
        except OSError as error:
            refuse(f"cannot write {json_file}: {error.strerror}")


def _condition(
    *,
    case: int | None,
    cylinder_diameter_mm: float | None,
    cable_diameter_mm: float | None,
    tension_mpa: float | None,
    tension_n: float | None,
    material: dict[str, tuple[float | None, float]],
    marker_spacing_mm: float | None,
    markers: int,
) -> Case:
    import math
    from dataclasses import replace

    from cable_winding.cases import Case, Material, paper_case

    own = {
        "cylinder_diameter": cylinder_diameter_mm,
        "cable_diameter": cable_diameter_mm,
        "marker_spacing": marker_spacing_mm,
    }
    given: dict[str, Any] = {k: v * MILLIMETRE for k, v in own.items() if v is not None}
    given["marker_count"] = markers
    stuff = {name: value * unit for name, (value, unit) in material.items() if value is not None}
    if case is not None:
        start = paper_case(case)
        given["material"] = replace(start.material, **stuff)
    else:
        wanted = {
            "--cylinder-diameter-mm": cylinder_diameter_mm,
            "--cable-diameter-mm": cable_diameter_mm,
            "--tension-n or --tension-mpa": tension_mpa if tension_n is None else tension_n,
        }
        missing = [name for name, value in wanted.items() if value is None]
        if missing:
            raise ValueError(f"give --case, or all of one's own: missing {', '.join(missing)}")
        start = None
        given["material"] = Material(**stuff)
        given.setdefault("marker_spacing", 100.0 * MILLIMETRE)
    if tension_n is not None:
        given["weight"] = tension_n
    elif tension_mpa is not None:
        diameter = given.get("cable_diameter", start.cable_diameter if start else 0.0)
        given["weight"] = tension_mpa * MEGAPASCAL * math.pi * diameter**2 / 4.0
    if start is None:
        return Case(**given)
    changed = set(given) - {"material", "marker_count"}
    number = 0 if changed or stuff else start.number
    return replace(start, number=number, **given)


def _wind(config: Any, drive: Any, duration: float, element: str) -> Prediction:
    from cable_fem_node.compile import is_compiled

    console = Console(stderr=True)
    if not is_compiled():
        console.print("compiling the solver's kernels: once after installation, a minute at most")
    with Progress(
        TextColumn(f"winding with the {element}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        console=console,
        transient=True,
    ) as bar:
        task = bar.add_task("winding", total=1.0)

        def show(share: float) -> None:
            bar.update(task, completed=share)

        if element == "solid":
            from cable_fem_node.solid_winding import predict_solid as wind
        else:
            from cable_fem_node.prediction import predict as wind
        result: Prediction = wind(config, drive, duration, show)
        return result


def _print(result: Prediction, element: str) -> None:
    console = Console()
    case = result.config.case
    title = f"case {case.number}" if case.number else "own condition"
    table = Table(title=f"Markers after {result.duration:g} s, {title}, {element}")
    for column in ("marker", "theta [rad]", "z [mm]", "S [mm]", "on the cylinder"):
        table.add_column(column, justify="right")
    for row in result.markers[1:]:
        table.add_row(
            f"P{row['id']}",
            f"{row['theta']:.3f}",
            f"{row['z'] / MILLIMETRE:.2f}",
            f"{row['s'] / MILLIMETRE:.2f}",
            "no" if row["flags"] else "yes",
        )
    console.print(table)
    turns = Table(title="Turns")
    for column in ("turn", "cable used [mm]", "advance [mm]"):
        turns.add_column(column, justify="right")
    for n, (used, pitch) in enumerate(
        zip(result.cable_per_turn(), result.pitch_per_turn(), strict=True), start=1
    ):
        turns.add_row(str(n), f"{used / MILLIMETRE:.2f}", f"{pitch / MILLIMETRE:.2f}")
    console.print(turns)
    energy, tension = result.energy, result.cable["tension"]
    laid = max(2, result.arc.size)
    console.print(
        f"law {result.config.law}: stretch {result.stretch:.5f}, closed form "
        f"{result.stretch_closed_form:.5f} at the wound tension, {result.span_stretch:.5f} in the "
        f"span\ntension: wound {tension[:laid].min():.3f} to {tension[:laid].max():.3f} N, "
        f"span {tension[-1]:.3f} N\nenergy [J]: kinetic {energy.kinetic:.3g}, "
        f"internal {energy.internal:.3g}, contact {energy.contact:.3g}, "
        f"external {energy.external:.3g}, friction {energy.friction:.3g}, "
        f"damping {energy.damping:.3g}; balance open by {energy.balance_pct:.3g} %, "
        f"kinetic over internal {energy.kinetic_over_internal:.2g}\n"
        f"speed: {result.cpu_s_per_sim_s:.4f} CPU seconds per simulated second",
        highlight=False,
    )


def _record(result: Prediction, element: str) -> dict[str, Any]:
    energy = result.energy
    return {
        "element": element,
        "law": result.config.law,
        "case": result.config.case.number,
        "markers": [
            {
                "id": int(row["id"]),
                "theta_rad": float(row["theta"]),
                "z_m": float(row["z"]),
                "s_m": float(row["s"]),
                "wound": not row["flags"],
            }
            for row in result.markers[1:]
        ],
        "cable_per_turn_m": result.cable_per_turn().tolist(),
        "pitch_per_turn_m": result.pitch_per_turn().tolist(),
        "cable": {
            "s_m": result.cable["s"].tolist(),
            "tension_n": result.cable["tension"].tolist(),
        },
        "energy_j": {
            name: getattr(energy, name)
            for name in ("kinetic", "internal", "contact", "external", "friction", "damping")
        },
        "energy_balance_pct": energy.balance_pct,
        "kinetic_over_internal": energy.kinetic_over_internal,
        "stretch": result.stretch,
        "stretch_closed_form": result.stretch_closed_form,
        "span_stretch": result.span_stretch,
        "cpu_s_per_sim_s": result.cpu_s_per_sim_s,
    }
