"""`winding identify`: the material of a cable, from its markers or from a tensile test."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cable_fem_node.winding.rig_prior import KNOWN_TENSION, RigPrior
from cable_fem_node.winding.winding_config import WindingConfig
from winding_cli.offline.tracked_source import tracked_run
from winding_cli.terminal.console import Shown, busy, record_table, result_console
from winding_cli.terminal.output_path import Force, Json, check_output_file, write_json
from winding_cli.terminal.record_options import Typed, spelled, with_options
from winding_cli.terminal.refusal import FAILED, refuse, refused
from winding_core.markers import Markers
from winding_core.parameters import typed_values
from winding_core.units import KILOPASCAL, MEGAPASCAL, MILLIMETRE, json_values
from winding_study.run_parameters import RunParameters

if TYPE_CHECKING:
    from cable_fem_node.identification import TrackedRun
    from winding_study.identification.tensile import LawFit


def _share(item: LawFit) -> str:
    if item.law != "mooney_rivlin":
        return "-"
    return f"{item.share:.2f} +- {item.share_standard_error:.2f}"


_LAWS = (
    Shown("law", lambda item: item.law),
    Shown("E, MPa", lambda item: item.young, ".4g", MEGAPASCAL),
    Shown("standard error", lambda item: item.young_standard_error, ".2g", MEGAPASCAL),
    Shown("C01 share", _share),
    Shown("rms, kPa", lambda item: item.rms, ".3g", KILOPASCAL),
    Shown("AICc", lambda item: item.aicc, ".1f"),
)


@with_options(RunParameters, RigPrior)
def identify(
    typed: Typed,
    known: Typed,
    *,
    sources: Annotated[
        list[Path] | None,
        typer.Argument(help="Recordings (folder, .mcap) or tables of markers (.csv) of one cable."),
    ] = None,
    tensile: Annotated[
        Path | None,
        typer.Option(help="CSV of a tensile test instead: strain, stress_mpa (nominal)."),
    ] = None,
    weight_n: Annotated[
        list[float] | None,
        typer.Option(help="Weight of each source in turn, in N; repeat it for each."),
    ] = None,
    use: Annotated[
        int | None, typer.Option(min=1, help="Identify from the first so many markers alone.")
    ] = None,
    rig: Annotated[
        bool,
        typer.Option(
            "--rig",
            help="Identify the rig with the material: free length, load share, drag, build-up.",
        ),
    ] = False,
    known_tension: Annotated[
        bool,
        typer.Option(
            "--known-tension", help="With --rig: the configured tension is the span's own."
        ),
    ] = False,
    fixing_mm: Annotated[
        float | None,
        typer.Option(help="With --rig: standard deviation of where P0 was fixed, in mm; else 0."),
    ] = None,
    scatter_mm: Annotated[
        float | None,
        typer.Option(help="With --rig: the same of every other marker's place, in mm; else 0."),
    ] = None,
    json_file: Json = None,
    force: Force = False,
) -> None:
    """Identify the cable's material from tracked markers by inverse winding, or from a test."""
    if (tensile is None) == (not sources):
        refuse("give recordings or tables of markers, or --tensile with a stress-strain table")
    if rig and tensile is not None:
        refuse("--rig needs markers, --tensile has none")
    if not rig and (known_tension or fixing_mm is not None or scatter_mm is not None):
        refuse("--known-tension, --fixing-mm and --scatter-mm need --rig")
    if not rig and known:
        refuse(f"{spelled(next(iter(known)))} needs --rig")
    check_output_file(json_file, "--json", force=force)
    with refused(ValueError):
        if tensile is not None:
            record = _tensile(tensile, RunParameters.from_typed(typed, case=RunParameters.case))
        else:
            runs = _runs(sources or [], weight_n or [], typed)
            if rig:
                prior = _prior(known_tension, known, fixing_mm or 0.0, scatter_mm or 0.0)
                record = _rig(runs, use, prior)
            else:
                record = _identified(runs, use)
    write_json(json_file, record)
    if record.get("refused"):
        refuse(record["refused"], FAILED)


def _runs(sources: list[Path], weights: list[float], typed: Typed) -> list[TrackedRun]:
    from winding_study.identification.sources import SourceError

    if weights and len(weights) != len(sources):
        raise SourceError(
            f"give --weight-n once for each of {len(sources)} sources, got {len(weights)}"
        )
    own: list[Typed] = [typed] * len(sources)
    if weights:
        own = [{**typed, "tension_n": weight, "tension_mpa": None} for weight in weights]
    return [tracked_run(source, each) for source, each in zip(sources, own, strict=True)]


def _first(runs: list[TrackedRun], use: int | None) -> list[TrackedRun]:
    """Return the runs with their first markers alone; None: with all."""
    if use is None:
        return runs
    return [dataclasses.replace(run, readings=run.readings.first(use)) for run in runs]


def _prior(known_tension: bool, known: Typed, fixing_mm: float, scatter_mm: float) -> RigPrior:
    ranges: dict[str, Any] = typed_values(RigPrior, known, spelled)
    return dataclasses.replace(
        KNOWN_TENSION if known_tension else RigPrior(),
        fixing=fixing_mm * MILLIMETRE,
        scatter=scatter_mm * MILLIMETRE,
        **ranges,
    )


def _rig(runs: list[TrackedRun], use: int | None, prior: RigPrior) -> dict[str, Any]:
    from cable_fem_node.identification import identify_rig
    from winding_cli.offline.identified import print_rig, rig_record

    with busy("identifying the rig"):
        posterior = identify_rig(_first(runs, use), prior)
    record = rig_record(posterior, runs)
    print_rig(result_console(), posterior, record)
    return record


def _identified(runs: list[TrackedRun], use: int | None) -> dict[str, Any]:
    from cable_fem_node.identification import identify_modulus, with_young
    from winding_cli.offline.identified import print_constants, print_fit, print_modulus, print_rest
    from winding_study.identification.constants import identify_constants

    used, law = _first(runs, use), runs[0].config.law
    console = result_console()
    if len(runs) > 1 and law in ("neo_hookean", "mooney_rivlin"):
        with busy(f"identifying the constants of law {law}"):
            constants = identify_constants(used, law)
        record = print_constants(console, constants)
        record["refused"] = ""
        fit, young = constants.fit, constants.young
        ratio = constants.share / (1.0 - constants.share)
    else:
        with busy("identifying the modulus"):
            estimate = identify_modulus(used)
        record = print_modulus(console, estimate)
        record["refused"] = estimate.refusal()
        fit, young, ratio = estimate.fit, estimate.young, runs[0].config.mooney_ratio
    record |= print_fit(console, fit)
    if not record["refused"]:
        record["predicted"] = []
        for number, (run, part) in enumerate(zip(runs, used, strict=True)):
            config = dataclasses.replace(with_young(run.config, young), mooney_ratio=ratio)
            predicted = _wound(run, config)
            record["predicted"] += print_rest(console, number, run, part, predicted)
    return record


def _wound(run: TrackedRun, config: WindingConfig) -> Markers:
    from cable_fem_node.winding.rod_winding import RodWinding
    from cable_fem_node.winding.run_ahead import replay

    model = RodWinding(config)
    replay(run.inputs, model)
    return model.markers()


def _tensile(path: Path, parameters: RunParameters) -> dict[str, Any]:
    from winding_study.identification.sources import read_tensile_test
    from winding_study.identification.tensile import fit_laws, judgement

    poisson = parameters.poisson
    fits = fit_laws(read_tensile_test(path), poisson)
    console = result_console()
    console.print(record_table(_LAWS, fits, title=f"Laws of {path.name}, best first"))
    console.print(judgement(fits))
    laws = [json_values(item, *vars(item)) for item in fits]
    return {"poisson": poisson, "judgement": judgement(fits), "laws": laws}
