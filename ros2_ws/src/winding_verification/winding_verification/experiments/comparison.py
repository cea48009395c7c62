"""The experiments of cosseratbench in a folder: ours beside the figures that it published."""

import json
from collections.abc import Callable, Collection, Iterable, Iterator
from functools import partial
from pathlib import Path

from winding_verification.experiments import cosserat_experiments as cosserat
from winding_verification.experiments import elastic_capstan
from winding_verification.experiments import held_cable_comparison as held
from winding_verification.experiments.motion_capture import cable_folders, read_cable
from winding_verification.experiments.scenario import (
    ExternalFileError,
    ExternalRow,
    Scenario,
    read_scenario,
)

EXPERIMENTS: dict[str, Callable[[Scenario], cosserat.Metrics]] = {
    "cantilever": cosserat.cantilever,
    "capstan": cosserat.capstan,
    "catenary": cosserat.catenary,
    "pendulum": cosserat.pendulum,
    "twist": cosserat.twist,
}
NAMES = (*EXPERIMENTS, held.NAME, elastic_capstan.NAME)
# Name of an experiment, and what computes it.
Work = tuple[str, Callable[[], Iterable[ExternalRow]]]

# Greatest magnitude. The references leave out: bending in the catenary, which lifts the sag of a
# short span by 0.8 %; the size of the swing, 2e-5 of the period; stretch and shear elsewhere.
_BARS = {
    "tip_deflection_error": 1.0e-3,
    "shape_error": 5.0e-3,
    "sag_error": 1.0e-2,
    "period_error": 5.0e-4,
    "amplitude_change": 1.0e-3,
    "critical_twist_error": 5.0e-3,
}
_HOLDS, _SLIDES = 2.0e-4, 1.0e-2  # A rope that holds moves by less [m], one that does not by more
_OF_THE_SOLVER = ("resolution", "time_step_scale")  # What varies the solver and not the experiment


def found_experiments(
    folder: Path, wanted: Collection[str] = tuple(EXPERIMENTS)
) -> tuple[list[Path], tuple[str, ...]]:
    """Return the files below a folder to compare, each problem once, and the names of others there.

    Raises:
        ExternalFileError: A file is no experiment.
    """
    chosen: dict[tuple[str, str], tuple[bool, Path]] = {}
    others = set()
    for file in sorted(folder.rglob("experiment.json")):
        name, values, of_the_solver = _identity(file)
        if name not in wanted:
            others.add(name)
            continue
        before = chosen.get((name, values))
        if before is None or (before[0] and not of_the_solver):
            chosen[name, values] = (of_the_solver, file)
    return [file for _, (_, file) in sorted(chosen.items())], tuple(sorted(others))


def compare(file: Path) -> Iterator[ExternalRow]:
    """Wind through one experiment; yield its quantities.

    Raises:
        ExternalFileError: The file is no experiment, or asks for what the rod has not.
        SolverError: The rod cannot compute it.
    """
    scenario = read_scenario(file)
    if lacks := _lacks(scenario):
        raise ExternalFileError(f"{file}: a {scenario.experiment} needs {lacks}")
    for quantity, computed in EXPERIMENTS[scenario.experiment](scenario).items():
        at_least = quantity == "slide" and scenario.values["overhang"] > 1.0
        bar = (_SLIDES if at_least else _HOLDS) if quantity == "slide" else _BARS[quantity]
        yield ExternalRow(
            experiment=scenario.experiment,
            variant=scenario.variant,
            quantity=quantity,
            computed=float(computed),
            bar=bar,
            at_least=at_least,
            published={
                solver: metrics.get(quantity) for solver, metrics in scenario.published.items()
            },
        )


def _lacks(scenario: Scenario) -> str:
    """Return what an experiment lacks and cannot be compared without; empty if nothing."""
    loaded = all(rod.load.any() for rod in scenario.rods)
    turned = all(rod.turn.size and rod.turn[-1] > 0.0 for rod in scenario.rods)
    needs = {
        "cantilever": (("a load", loaded),),
        "capstan": (
            ("gravity", bool(scenario.gravity.any())),
            ("a cylinder", bool(scenario.obstacles)),
            ("an overhang", "overhang" in scenario.values),
        ),
        "catenary": (("gravity", bool(scenario.gravity.any())),),
        "pendulum": (("gravity", bool(scenario.gravity.any())),),
        "twist": (("a load on every rod", loaded), ("an end_motion of every rod", turned)),
    }
    return " and ".join(what for what, given in needs[scenario.experiment] if not given)


def _identity(file: Path) -> tuple[str, str, bool]:
    """Return an experiment's name, its parameters as text, whether it varies the solver alone."""
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
        values = json.dumps(content["values"], sort_keys=True)
        varied = content.get("varied") or {}
        return str(content["name"]), values, any(name in varied for name in _OF_THE_SOLVER)
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise ExternalFileError(f"{file} is no experiment of cosseratbench: {error}") from error


def found_work(folder: Path, wanted: Collection[str] = NAMES) -> tuple[list[Work], tuple[str, ...]]:
    """Return what to compute of what lies below a folder, and the names of what is not computed.

    Raises:
        ExternalFileError: The folder holds nothing of that, or a file is no experiment.
    """
    work: list[Work] = []
    lacking = []
    others: tuple[str, ...] = ()
    scenarios = [name for name in wanted if name in EXPERIMENTS]
    if scenarios:
        files, others = found_experiments(folder, scenarios)
        work += [(file.parent.name, partial(compare, file)) for file in files]
        if not files:
            lacking.append(
                f"{folder} holds no experiment.json of {', '.join(scenarios)}; it is to be a "
                "results folder of cosseratbench, or one above it"
            )
    if held.NAME in wanted:
        cables = cable_folders(folder)
        comparison = held.HeldCableComparison()
        work += [(one.name, partial(comparison.compare, read_cable(one))) for one in cables]
        if cables:
            work.append(("all cables", comparison.reached))
        else:
            lacking.append(f"{folder} holds no runs of DEFORM (CABLE/train and CABLE/eval, *.pkl)")
    if elastic_capstan.NAME in wanted:
        tables = sorted(folder.rglob(elastic_capstan.TABLE))
        work += [
            (elastic_capstan.NAME, partial(elastic_capstan.compare_points, points))
            for points in map(elastic_capstan.read_table, tables)
        ]
        if not tables:
            lacking.append(
                f"{folder} holds no {elastic_capstan.TABLE}, a table with the columns "
                f"{', '.join(elastic_capstan.LIMITS)}"
            )
    if not work:
        raise ExternalFileError("; ".join(lacking))
    return work, others
