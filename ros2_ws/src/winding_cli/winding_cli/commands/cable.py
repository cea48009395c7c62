"""`winding cable`: list, show and compare the cables of the library, and add your own."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from winding_cli.app import command_group
from winding_cli.offline.tracked_source import tracked_run
from winding_cli.terminal.console import Shown, busy, record_table, result_console
from winding_cli.terminal.output_path import Force, Json, check_output_file, write_json, write_text
from winding_cli.terminal.record_options import Library, Typed, spelled, with_declared, with_options
from winding_cli.terminal.refusal import refuse, refused
from winding_core.cable.condition import Condition
from winding_core.catalogue.cables import (
    PROPERTIES,
    Cable,
    CableError,
    cables,
    check_cable,
    check_name,
    find_cable,
    own_folder,
)
from winding_core.parameters import explained, option_kind, options, typed_values
from winding_core.units import MEGAPASCAL, MILLIRADIAN, json_values
from winding_study.run_parameters import RunParameters

cable = command_group(__doc__)
Name = Annotated[str, typer.Argument(help="Cable of the library, or a cable file.")]
_DECLARED = options(Condition)
_PROPERTY = {
    key: Annotated[
        option_kind(_DECLARED[key]) | None,
        typer.Option(spelled(key), help=explained(_DECLARED[key])),
    ]
    for key in PROPERTIES
}
_LISTED = (
    Shown("cable", lambda item: item.name),
    Shown("what", lambda item: item.title),
    Shown("whose", lambda item: "shipped" if item.path is None else "own"),
    Shown("d, mm", lambda item: item.properties["cable_diameter_mm"], ".4g"),
    Shown("E, MPa", lambda item: item.properties["young_mpa"], ".4g"),
    Shown("one standard deviation", lambda item: item.uncertainty.get("young_mpa"), ".2g"),
    Shown("law", lambda item: str(item.properties.get("law", Condition.law))),
)


_LIKELY = (
    Shown("cable", lambda item: item.name or "none of them"),
    Shown("probability", lambda item: item.probability, ".3f"),
    Shown("E then, MPa", lambda item: item.young, ".4g", MEGAPASCAL),
    Shown("misses by, mrad", lambda item: item.missed, ".1f", MILLIRADIAN),
    Shown("left out because", lambda item: item.refusal),
)


@cable.command(name="list")
def list_cables(library: Library = None, json_file: Json = None, force: Force = False) -> None:
    """List the cables of the library."""
    check_output_file(json_file, "--json", force=force)
    with refused(CableError):
        found = list(cables(library).values())
    result_console().print(record_table(_LISTED, found, words=3))
    write_json(json_file, {"cables": [_record(item) for item in found]})


@cable.command()
def show(name: Name, library: Library = None, json_file: Json = None, force: Force = False) -> None:
    """Show a cable: every value with its uncertainty and source."""
    check_output_file(json_file, "--json", force=force)
    with refused(CableError):
        found = find_cable(name, library)
    columns = (
        Shown("property", lambda key: key),
        Shown("value", lambda key: str(found.properties[key])),
        Shown("one standard deviation", found.uncertainty.get, "g"),
        Shown("source", lambda key: found.sources.get(key, "-")),
    )
    console = result_console()
    console.print(found.title)
    console.print(record_table(columns, found.properties, words=1))
    winding = ", ".join(f"{key} {value}" for key, value in found.winding.items())
    for subject, text in (
        ("source", found.source),
        ("note", found.note),
        ("trial winding", winding),
        ("file", str(found.path or "")),
    ):
        if text:
            console.print(f"{subject}: {text}", soft_wrap=True)
    write_json(json_file, {"cables": [_record(found)]})


@cable.command()
def compare(
    first: Name, second: Name, library: Library = None, json_file: Json = None, force: Force = False
) -> None:
    """Show two cables side by side, with what differs by more than its uncertainty."""
    check_output_file(json_file, "--json", force=force)
    with refused(CableError):
        pair = find_cable(first, library), find_cable(second, library)
    keys = [key for key in PROPERTIES if any(key in item.properties for item in pair)]
    rows = [
        (key, *(item.properties.get(key, "-") for item in pair), _deviations(key, *pair))
        for key in keys
    ]
    columns = (
        Shown("property", lambda row: row[0]),
        Shown(pair[0].name, lambda row: str(row[1])),
        Shown(pair[1].name, lambda row: str(row[2])),
        Shown("standard deviations apart", lambda row: row[3], ".1f"),
    )
    result_console().print(record_table(columns, rows, words=1))
    apart = {row[0]: row[3] for row in rows}
    write_json(json_file, {"cables": [*map(_record, pair)], "deviations_apart": apart})


@cable.command()
@with_options(RunParameters)
def nearest(
    typed: Typed,
    *,
    source: Annotated[
        Path, typer.Argument(help="Recording (folder, .mcap) or table of markers (.csv).")
    ],
    library: Library = None,
    json_file: Json = None,
    force: Force = False,
) -> None:
    """Name the cable of the library that a run's markers show, with its probability."""
    from winding_study.identification.nearest_cable import likenesses

    check_output_file(json_file, "--json", force=force)
    with refused(ValueError), busy("winding the cables of the library"):
        shelf = cables(library)
        found = likenesses(tracked_run(source, typed), shelf)
    result_console().print(record_table(_LIKELY, found, words=1))
    likely = [
        json_values(item, "name", "probability", "young_pa", "missed_rad")
        | {"refusal": item.refusal or None}
        for item in found
    ]
    write_json(json_file, {"cables": [*map(_record, shelf.values())], "nearest": likely})


@cable.command()
@with_declared(_PROPERTY)
def add(
    typed: Typed,
    *,
    name: Annotated[str, typer.Argument(help="Of the new cable.")],
    title: Annotated[str, typer.Option(help="What it is, in words.")] = "",
    source: Annotated[str, typer.Option(help="Where its data are from.")] = "",
    like: Annotated[
        str, typer.Option(help="Cable, or cable file, whose other properties it has.")
    ] = "",
    identified: Annotated[
        Path | None,
        typer.Option(help="JSON of `winding identify`, with markers or --tensile: E and law."),
    ] = None,
    uncertainty: Annotated[
        list[str] | None,
        typer.Option(help="One standard deviation, as young_mpa=0.1; may be repeated."),
    ] = None,
    library: Library = None,
    force: Force = False,
) -> None:
    """Add a cable to the own library, or a better one of its name with --force."""
    folder = library or own_folder()
    with refused(ValueError):
        file = folder / f"{check_name(name)}.yaml"
        made = find_cable(like, library) if like else Cable(name=name, title=name)
        sources = dict(made.sources)
        given: dict[str, Any] = {}
        deviations: dict[str, float] = {}
        if identified is not None:
            given, deviations = _identified(identified)
            sources |= dict.fromkeys(given, f"winding identify, {identified.name}")
        typed_values(Condition, typed, spelled)
        given |= typed
        deviations |= dict(map(_deviation, uncertainty or ()))
        if source:
            sources |= dict.fromkeys(typed, source)
        # What is known of another value is not known of this one.
        kept = {key: sigma for key, sigma in made.uncertainty.items() if key not in given}
        made = check_cable(
            replace(
                made,
                name=name,
                title=title or made.title,
                source=source or made.source,
                properties={**made.properties, **given},
                uncertainty={**kept, **deviations},
                sources={key: text for key, text in sources.items() if text},
            )
        )
    check_output_file(file, make_folder=True, force=force)
    write_text(file, made.text())
    print(f"{file}: winding cable show {name}")


def _deviation(text: str) -> tuple[str, float]:
    key, _, number = text.partition("=")
    try:
        if key in PROPERTIES:
            return key, float(number)
    except ValueError:
        pass
    refuse(f"--uncertainty must be as young_mpa=0.1, of a property, got {text!r}")


def _identified(file: Path) -> tuple[dict[str, Any], dict[str, float]]:
    """Return the properties that an identification found, and their standard deviations.

    Raises:
        CableError: It is none, or must not be used.
    """
    try:
        record = json.loads(file.read_bytes())
        if record.get("refused"):
            raise CableError(f"{file} must not be used: {record['refused']}")
        # Of a tensile test the best law is the first.
        found = record["laws"][0] if "laws" in record else record
        young, sigma = (
            float(found[key]) / MEGAPASCAL for key in _KEYS["laws" if "laws" in record else ""]
        )
        given = {"young_mpa": young, "law": str(found["law"])}
        if given["law"] == "mooney_rivlin" and "share" in found:
            given["mooney_ratio"] = float(found["share"]) / (1.0 - float(found["share"]))
        elif given["law"] == "mooney_rivlin":
            given["mooney_ratio"] = float(found["c01_pa"]) / float(found["c10_pa"])
    except OSError as error:
        raise CableError(f"{file} cannot be read: {error.strerror or error}") from error
    except CableError:
        raise
    except (ValueError, KeyError, TypeError, IndexError, AttributeError, ArithmeticError) as error:
        raise CableError(f"{file} is no result of winding identify with a modulus") from error
    return given, {"young_mpa": sigma}


_KEYS = {"laws": ("young", "young_standard_error"), "": ("young_pa", "standard_error_pa")}


def _deviations(key: str, first: Cable, second: Cable) -> float | None:
    """Return how many standard deviations two values are apart; None where that is not known."""
    values: list[Any] = [item.properties.get(key) for item in (first, second)]
    sigmas = [item.uncertainty.get(key, 0.0) for item in (first, second)]
    together = (sigmas[0] ** 2 + sigmas[1] ** 2) ** 0.5
    if together == 0.0 or not all(isinstance(value, int | float) for value in values):
        return None
    return float(abs(values[1] - values[0]) / together)


def _record(item: Cable) -> dict[str, Any]:
    return {
        **json_values(item, "name", "title"),
        "source": item.source or None,
        "note": item.note or None,
        "file": None if item.path is None else str(item.path),
        "properties": {
            key: {
                "value": value,
                "uncertainty": item.uncertainty.get(key),
                "source": item.sources.get(key),
            }
            for key, value in item.properties.items()
        },
        "winding": dict(item.winding),
    }
