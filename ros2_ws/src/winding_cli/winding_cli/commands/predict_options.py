"""Options of `winding predict`: declared once for the command line and for sweeps."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_type_hints

import typer

if TYPE_CHECKING:
    from winding_core.cases import Case
    from winding_study.runs.planned_run import PlannedRun

MILLIMETRE = 1.0e-3
MEGAPASCAL = 1.0e6


@dataclass(frozen=True, kw_only=True)
class PredictOptions:
    """What `winding predict` is asked to wind, in the units of the command line."""

    case: Annotated[int | None, typer.Option(help="Row of the paper's Table 1 (1 to 12).")] = None
    cylinder_diameter_mm: Annotated[float | None, typer.Option(help="Diameter in mm.")] = None
    cable_diameter_mm: Annotated[float | None, typer.Option(help="Undeformed, in mm.")] = None
    tension_mpa: Annotated[
        float | None, typer.Option(help="Weight over the undeformed section, in MPa.")
    ] = None
    tension_n: Annotated[float | None, typer.Option(help="Weight on the cable's end, in N.")] = None
    young_mpa: Annotated[float | None, typer.Option(help="Young's modulus in MPa; 2.6.")] = None
    poisson: Annotated[float | None, typer.Option(help="Poisson's ratio; 0.47.")] = None
    density: Annotated[float | None, typer.Option(help="In kg/m^3; 1337.")] = None
    friction: Annotated[float, typer.Option(help="Coulomb friction, cable on cylinder.")] = 0.1
    guide_distance_mm: Annotated[
        float | None, typer.Option(help="Guide to cylinder axis, in mm; else a span of 198 mm.")
    ] = None
    marker_spacing_mm: Annotated[
        float | None,
        typer.Option(help="Along the undeformed cable, in mm; else the case's, or 100."),
    ] = None
    markers: Annotated[int, typer.Option(help="Markers after P0.")] = 4
    feed_mm_s: Annotated[float, typer.Option(help="Carriage speed after the ramp.")] = 5.0
    omega_rad_s: Annotated[float, typer.Option(help="Cylinder speed after the ramp.")] = 1.74
    duration_s: Annotated[float, typer.Option(help="Time to wind, in s.")] = 20.0
    segment_mm: Annotated[float, typer.Option(help="Length of an element, in mm.")] = 5.0
    law: Annotated[
        str,
        typer.Option(help="linear, hencky, hencky_cauchy, neo_hookean or mooney_rivlin."),
    ] = "linear"
    element: Annotated[str, typer.Option(help="rod or solid.")] = "rod"
    mass_scaling: Annotated[
        float | None, typer.Option(help="Factor on the density; rod 1, solid 400.")
    ] = None
    rolling: Annotated[
        bool, typer.Option("--rolling/--no-rolling", help="Let the rod roll on the cylinder.")
    ] = False

    def plan(self) -> PlannedRun:
        """Return the run in SI units.

        Raises:
            ValueError: The options contradict each other, leave something out, or leave the
                range of the model.
        """
        from cable_fem_node.winding.winding_config import WindingConfig
        from winding_core.drive import DriveProfile
        from winding_core.fleet_angle import PAPER_FREE_LENGTH, free_length_of
        from winding_study.runs.planned_run import PlannedRun

        if self.element not in ("rod", "solid"):
            raise ValueError(f"element must be rod or solid, got {self.element!r}")
        if self.tension_mpa is not None and self.tension_n is not None:
            raise ValueError("give the tension once: --tension-mpa or --tension-n")
        condition = self._condition()
        free_length = PAPER_FREE_LENGTH
        if self.guide_distance_mm is not None:
            free_length = free_length_of(
                self.guide_distance_mm * MILLIMETRE, condition.centreline_radius
            )
        scaling = self.mass_scaling
        if scaling is None:
            scaling = 1.0 if self.element == "rod" else 400.0
        return PlannedRun(
            config=WindingConfig(
                case=condition,
                friction=self.friction,
                law=self.law,
                segment_length=self.segment_mm * MILLIMETRE,
                free_length=free_length,
                mass_scaling=scaling,
                rolling=self.rolling,
            ),
            drive=DriveProfile(
                angular_speed=self.omega_rad_s, feed_speed=self.feed_mm_s * MILLIMETRE
            ),
            duration=self.duration_s,
            element=self.element,
        )

    def resolved(self, run: PlannedRun) -> PredictOptions:
        """Return the same options with nothing left open, as the run has them; case 0 is none."""
        from winding_core.fleet_angle import guide_distance_of

        config = run.config
        case, material = config.case, config.case.material
        found: dict[str, float] = {
            "case": 0,
            "cylinder_diameter_mm": case.cylinder_diameter / MILLIMETRE,
            "cable_diameter_mm": case.cable_diameter / MILLIMETRE,
            "tension_mpa": case.nominal_stress / MEGAPASCAL,
            "tension_n": case.weight,
            "young_mpa": material.young / MEGAPASCAL,
            "poisson": material.poisson,
            "density": material.density,
            "guide_distance_mm": guide_distance_of(config.free_length, case.centreline_radius)
            / MILLIMETRE,
            "marker_spacing_mm": case.marker_spacing / MILLIMETRE,
            "mass_scaling": config.mass_scaling,
        }
        # Twelve digits: a change of units shall not show as 30.000000000000004.
        missing: dict[str, Any] = {
            name: value if isinstance(value, int) else float(f"{value:.12g}")
            for name, value in found.items()
            if getattr(self, name) is None
        }
        return dataclasses.replace(self, **missing)

    def _condition(self) -> Case:
        from winding_core.cases import Case, Material, paper_case

        lengths = {
            "cylinder_diameter": self.cylinder_diameter_mm,
            "cable_diameter": self.cable_diameter_mm,
            "marker_spacing": self.marker_spacing_mm,
        }
        given: dict[str, Any] = {k: v * MILLIMETRE for k, v in lengths.items() if v is not None}
        given["marker_count"] = self.markers
        material = {
            "young": None if self.young_mpa is None else self.young_mpa * MEGAPASCAL,
            "poisson": self.poisson,
            "density": self.density,
        }
        stuff = {name: value for name, value in material.items() if value is not None}
        if self.case is not None:
            start = paper_case(self.case)
            given["material"] = dataclasses.replace(start.material, **stuff)
        else:
            tension = self.tension_mpa if self.tension_n is None else self.tension_n
            wanted = {
                "--cylinder-diameter-mm": self.cylinder_diameter_mm,
                "--cable-diameter-mm": self.cable_diameter_mm,
                "--tension-n or --tension-mpa": tension,
            }
            missing = [name for name, value in wanted.items() if value is None]
            if missing:
                raise ValueError(f"give --case, or all of one's own: missing {', '.join(missing)}")
            start = None
            given["material"] = Material(**stuff)
            given.setdefault("marker_spacing", 100.0 * MILLIMETRE)
        if self.tension_n is not None:
            given["weight"] = self.tension_n
        elif self.tension_mpa is not None:
            diameter = given.get("cable_diameter", start.cable_diameter if start else 0.0)
            given["weight"] = self.tension_mpa * MEGAPASCAL * math.pi * diameter**2 / 4.0
        if start is None:
            return Case(**given)
        changed = set(given) - {"material", "marker_count"}
        number = 0 if changed or stuff else start.number
        return dataclasses.replace(start, number=number, **given)


def option_types() -> dict[str, type]:
    """Return the type of every option by its name: bool, int, float or str."""
    hints = get_type_hints(PredictOptions)
    return {
        item.name: next(
            kind
            for kind in (get_args(hints[item.name]) or (hints[item.name],))
            if kind is not type(None)
        )
        for item in dataclasses.fields(PredictOptions)
    }
