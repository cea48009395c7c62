"""`winding train`: fit the weight h to the measured lengths and say how good it is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from winding_bringup.commands.refusal import refuse

if TYPE_CHECKING:
    from rich.table import Table

    from correction_node.evaluation import Score


def train(
    *,
    data: Annotated[
        str,
        typer.Option(
            help="Predicted lengths: paper (its simulation column), rod (our rod solver), or a "
            "CSV file with the columns case, marker, s_fem_m."
        ),
    ] = "rod",
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for weights.safetensors and card.json; else the shipped one."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the starting weights.")] = 0,
    steps: Annotated[int, typer.Option(min=1, help="Training steps.")] = 1500,
) -> None:
    """Train the network and compare it, in-sample and case by case left out, with baselines."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    from correction_node.dataset import load_data_set
    from correction_node.protocol import learn, verdict
    from correction_node.training import TrainingConfig
    from correction_node.weights import SHIPPED, save_weight, weights_directory

    console = Console()
    try:
        data_set = load_data_set(data)
    except (FileNotFoundError, ValueError) as error:
        refuse(error)
    if out is None:
        if data not in SHIPPED:
            refuse("give --out for weights trained on data of your own")
        out = weights_directory(data)
    trainings = 1 + len({cell.case for cell in data_set.cells})
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=console,
        transient=True,
    ) as progress:
        task = progress.add_task("training", total=trainings)
        learned = learn(
            data_set,
            TrainingConfig(seed=seed, steps=steps),
            lambda said: progress.update(task, advance=1, description=said),
        )
    save_weight(learned.weight, out)
    console.print(_table(learned.scores, data))
    console.print(verdict(learned.scores))
    bound = learned.weight.bound
    console.print(
        f"A corrected length is within {100 * bound.relative:.1f} % of the truth for "
        f"{100 * bound.level:.0f} % of cases like these; in-sample numbers promise nothing."
    )
    console.print(f"Weights and card: {out}", soft_wrap=True)


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
