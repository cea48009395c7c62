"""The list of commands that help prints without importing them."""

from typing import Any

import typer

from winding_cli.app import SUMMARIES, app


def test_help_lists_every_command_with_the_first_paragraph_of_its_own_help() -> None:
    commands: Any = typer.main.get_command(app)
    own = {
        name: " ".join(command.help.split("\n\n")[0].split())
        for name, command in commands.commands.items()
        if name in SUMMARIES
    }
    assert list(SUMMARIES.items()) == list(own.items())
