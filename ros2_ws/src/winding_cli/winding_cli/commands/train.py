"""`winding train`: fit the correction factor h to the measured lengths and judge it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from winding_cli.terminal.console import Shown, busy, record_table, result_console
from winding_cli.terminal.output_path import Force, check_output_folder, staged
from winding_cli.terminal.refusal import need_extra, refuse, refused

if TYPE_CHECKING:
    from correction_node.models.dataset import DataSet


def _pct(heading: str, name: str, missing: str = "") -> Shown:
    return Shown(heading, lambda scored: getattr(scored[1], name), ".2f", missing=missing)


_MODEL = Shown("model", lambda scored: scored[0])
_COMPARED = (
    _MODEL,
    Shown("kind", lambda scored: scored[1].kind),
    _pct("in-sample", "in_sample_pct"),
    _pct("+-", "in_sample_spread_pct"),
    _pct("leave one case out", "leave_one_case_out_pct"),
    _pct("+-", "leave_one_case_out_spread_pct"),
    _pct("worst case", "worst_case_pct"),
    _pct("bound 12/13", "bound_pct"),
)
_TRAINED = (
    _MODEL,
    _pct("in-sample", "in_sample_pct"),
    _pct("leave one case out", "leave_one_case_out_pct"),
    _pct("worst case left out", "worst_case_pct"),
)


def train(
    *,
    model: Annotated[
        str,
        typer.Option(
            help="Model: network (the paper's), marker network, rig (physics), rig network."
        ),
    ] = "rig network",
    data: Annotated[
        str,
        typer.Option(
            help="Predicted lengths: paper (its simulation column), rod (our rod solver), rod-N "
            "(without case N), or a CSV file with the columns case, marker, s_fem_m; or your own "
            "runs: folders or recordings, a folder of them, or a CSV file with the columns that "
            "docs/learning.md lists."
        ),
    ] = "rod",
    out: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "--out",
            help="Folder for weights.safetensors and card.json; else the shipped one.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the starting weights.")] = 0,
    steps: Annotated[int, typer.Option(min=1, help="Training steps.")] = 1500,
    compare: Annotated[
        bool, typer.Option("--compare", help="Only print all models, over seeds 0, 1 and 2.")
    ] = False,
    force: Force = False,
) -> None:
    """Learn the correction factor h and compare it, in-sample and by case left out, with others."""
    from correction_node.models.weights import SHIPPED, save_factor, weights_directory

    need_extra("train", "training models")
    # Before what trains is imported.
    models = dict.fromkeys(learned for _, learned in SHIPPED.values())
    if model not in models:
        refuse(f"--model must be one of {', '.join(models)}, got {model!r}")
    from correction_node.models.dataset import load_data_set
    from correction_node.models.own_runs import is_own, load_own_runs
    from correction_node.training.protocol import learn, verdict
    from correction_node.training.training import TrainingConfig

    console = result_console()
    with refused(FileNotFoundError, ValueError):
        if is_own(Path(data)):
            from winding_cli.offline.recorded_run import recorded_numbers

            data_set = load_own_runs(Path(data), recorded_numbers)
        else:
            data_set = load_data_set(data)
    if data_set.own:
        _learn_own(data_set, out, force=force)
        return
    if compare:
        _compare(data_set, steps)
        return
    if out is None:
        shipped = {learned: name for name, learned in SHIPPED.items()}
        if (data, model) not in shipped:
            refuse(f"give --output: no weights of model {model} on data {data} are shipped")
        out = weights_directory(shipped[data, model])
    check_output_folder(out, "--output", force=force)
    with refused(ValueError), busy("learning") as show:
        learned = learn(
            data_set,
            model,
            TrainingConfig(steps=steps),
            lambda words: show(description=words),
            seed=seed,
        )
    with staged(out) as place:
        save_factor(learned.factor, place)
    title = f"Mean error of a length, data '{data}', in % (Table 8's measure)"
    console.print(record_table(_TRAINED, learned.scores.items(), words=1, title=title))
    console.print(verdict(model, learned.scores), soft_wrap=True)
    bound = learned.factor.bound
    console.print(
        f"A corrected length is within {100 * bound.relative:.1f} % of the truth for "
        f"{100 * bound.level:.0f} % of cases like these; in-sample numbers promise nothing.",
        soft_wrap=True,
    )
    console.print(learned.factor.card["selection"], soft_wrap=True)
    console.print(f"Weights and card: {out}", soft_wrap=True)


def _learn_own(data_set: DataSet, out: Path | None, *, force: bool) -> None:
    from correction_node.models.weights import save_factor
    from correction_node.training.protocol import learn_own

    if out is None:
        refuse("give --output: a folder for what is learned from own runs")
    check_output_folder(out, "--output", force=force)
    with busy("learning") as show:
        learned = learn_own(data_set, lambda words: show(description=words))
    with staged(out) as place:
        save_factor(learned.factor, place)
    console, card = result_console(), learned.factor.card
    for sentence in data_set.refused:
        console.print(f"Left out: {sentence}", soft_wrap=True)
    title = f"Mean error of a length, own runs '{data_set.name}', in %; a case is a run"
    console.print(record_table(_TRAINED, learned.scores.items(), words=1, title=title))
    by_cable = card["cable_left_out_pct"]
    console.print(
        f"{card['inside_90_run_left_out_pct']:.0f} % of the lengths of runs left out lie in their "
        f"90 % intervals; cables: {', '.join(card['cables'])}"
        + ("" if by_cable is None else f"; with each cable left out {by_cable:.2f} %"),
        soft_wrap=True,
    )
    console.print(f"Weights and card: {out}", soft_wrap=True)


def _compare(data_set: DataSet, steps: int) -> None:
    from correction_node.training.comparison import compare_models

    with busy("learning") as show:
        scores = compare_models(
            data_set, steps=steps, progress=lambda words: show(description=words)
        )
    title = (
        f"Mean error of a length, data '{data_set.name}', in % (Table 8's measure); "
        "+- is largest minus smallest over three seeds"
    )
    result_console().print(record_table(_COMPARED, scores.items(), words=2, title=title))
