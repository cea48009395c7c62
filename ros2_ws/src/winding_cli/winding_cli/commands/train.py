"""`winding train`: fit the correction factor h to the measured lengths and say how good it is."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from winding_cli.commands.console import result_console
from winding_cli.commands.extras import need_extra
from winding_cli.commands.output_path import check_output_folder, staged
from winding_cli.commands.refusal import refuse, refused

if TYPE_CHECKING:
    from rich.table import Table

    from correction_node.models.dataset import DataSet
    from correction_node.training.evaluation import Score


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
            help="Predicted lengths: paper (its simulation column), rod (our rod solver), or a "
            "CSV file with the columns case, marker, s_fem_m."
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
        bool,
        typer.Option("--compare", help="Only print all models, over seeds 0, 1 and 2."),
    ] = False,
) -> None:
    """Learn the correction factor h and compare it, in-sample and by case left out, with others."""
    from rich.console import Console

    from correction_node.models.weights import SHIPPED, save_factor, weights_directory

    need_extra("train", "training models")
    # Before what trains is imported.
    models = dict.fromkeys(learned for _, learned in SHIPPED.values())
    if model not in models:
        refuse(f"--model must be one of {', '.join(models)}, got {model!r}")
    from correction_node.models.dataset import load_data_set
    from correction_node.training.protocol import learn, verdict
    from correction_node.training.training import TrainingConfig

    console = result_console()
    with refused(FileNotFoundError, ValueError):
        data_set = load_data_set(data)
    if compare:
        _compare(data_set, steps)
        return
    if out is None:
        shipped = {learned: name for name, learned in SHIPPED.items()}
        if (data, model) not in shipped:
            refuse(f"give --output: no weights of model {model} on data {data} are shipped")
        out = weights_directory(shipped[data, model])
    check_output_folder(out, "--output")
    with refused(ValueError), Console(stderr=True).status("learning") as status:
        learned = learn(data_set, model, TrainingConfig(steps=steps), status.update, seed=seed)
    with staged(out) as place:
        save_factor(learned.factor, place)
    console.print(_table(learned.scores, data))
    console.print(verdict(model, learned.scores), soft_wrap=True)
    bound = learned.factor.bound
    console.print(
        f"A corrected length is within {100 * bound.relative:.1f} % of the truth for "
        f"{100 * bound.level:.0f} % of cases like these; in-sample numbers promise nothing.",
        soft_wrap=True,
    )
    console.print(learned.factor.card["selection"], soft_wrap=True)
    console.print(f"Weights and card: {out}", soft_wrap=True)


def _compare(data_set: DataSet, steps: int) -> None:
    from rich.console import Console
    from rich.table import Table

    from correction_node.training.comparison import compare_models

    with Console(stderr=True).status("learning") as status:
        scores = compare_models(data_set, steps=steps, progress=status.update)
    table = Table(
        title=f"Mean error of a length, data '{data_set.name}', in % (Table 8's measure); "
        "+- is largest minus smallest over three seeds"
    )
    for column in ("model", "kind"):
        table.add_column(column, no_wrap=True)
    for column in ("in-sample", "+-", "leave one case out", "+-", "worst case", "bound 12/13"):
        table.add_column(column, justify="right")
    for name, score in scores.items():
        numbers = (
            score.in_sample_pct,
            score.in_sample_spread_pct,
            score.leave_one_case_out_pct,
            score.leave_one_case_out_spread_pct,
            score.worst_case_pct,
            score.bound_pct,
        )
        cells = ("" if n is None or math.isnan(n) else f"{n:.2f}" for n in numbers)
        table.add_row(name, score.kind, *cells)
    result_console().print(table)


def _table(scores: dict[str, Score], data: str) -> Table:
    from rich.table import Table

    table = Table(title=f"Mean error of a length, data '{data}', in % (Table 8's measure)")
    table.add_column("model")
    for column in ("in-sample", "leave one case out", "worst case left out"):
        table.add_column(column, justify="right")
    for name, score in scores.items():
        table.add_row(
            name,
            f"{score.in_sample_pct:.2f}",
            f"{score.leave_one_case_out_pct:.2f}",
            f"{score.worst_case_pct:.2f}",
        )
    return table
