"""The subcommands of `winding`; each is a file of its own and imports its packages late."""

from __future__ import annotations

import typer

from winding_cli.commands.bag import bag
from winding_cli.commands.board import board
from winding_cli.commands.calibrate import calibrate
from winding_cli.commands.conform import conform
from winding_cli.commands.dashboard import dashboard
from winding_cli.commands.doctor import doctor
from winding_cli.commands.faults import faults
from winding_cli.commands.graph import graph
from winding_cli.commands.health import health
from winding_cli.commands.identify import identify
from winding_cli.commands.predict import predict
from winding_cli.commands.render import render
from winding_cli.commands.run import run
from winding_cli.commands.serve import serve
from winding_cli.commands.study import study
from winding_cli.commands.sweep import sweep
from winding_cli.commands.track import track
from winding_cli.commands.train import train
from winding_cli.commands.verify import verify

app = typer.Typer(
    help="Predicts, watches and corrects how a flexible cable lays itself on a cylinder.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)
for _command in (
    run,
    serve,
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
