"""The `winding` command; each subcommand lives in a file of its own and imports its room late."""

from __future__ import annotations

import typer

from winding_bringup.commands.bag import bag
from winding_bringup.commands.board import board
from winding_bringup.commands.calibrate import calibrate
from winding_bringup.commands.conform import conform
from winding_bringup.commands.dashboard import dashboard
from winding_bringup.commands.doctor import doctor
from winding_bringup.commands.faults import faults
from winding_bringup.commands.graph import graph
from winding_bringup.commands.health import health
from winding_bringup.commands.identify import identify
from winding_bringup.commands.predict import predict
from winding_bringup.commands.render import render
from winding_bringup.commands.run import run
from winding_bringup.commands.study import study
from winding_bringup.commands.sweep import sweep
from winding_bringup.commands.track import track
from winding_bringup.commands.train import train
from winding_bringup.commands.verify import verify

app = typer.Typer(
    help="Predicts, watches and corrects how a flexible cable lays itself on a cylinder.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)
for _command in (
    run,
    predict,
    sweep,
    identify,
    study,
    verify,
    train,
    render,
    track,
    board,
    calibrate,
    conform,
    doctor,
    faults,
    dashboard,
    health,
    graph,
):
    app.command()(_command)
app.add_typer(bag, name="bag")


def main() -> None:
    """Entry point of the console script."""
    app()


if __name__ == "__main__":
    main()
