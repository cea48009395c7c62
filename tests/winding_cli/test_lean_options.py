"""Options that are read without Typer's validation have the values and refusals it gives."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from winding_cli.commands.lean_options import LeanCommand

NUMBERS = (
    "4", "04", "-0", "4.0", "1e3", "0.1e+05", "1.5", "-2.5e-3", "1_000", "nan", "inf", ".5", "5.",
    " 4", "", "\u0663", "9007199254740993", "123456789012345678", "four",
)  # fmt: skip


def output(cls: type[typer.core.TyperCommand], *words: str) -> tuple[int, str]:
    """Return the exit code and the text of a command that prints what it was given."""
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)

    @app.command(cls=cls, name="show")
    def show(
        whole: Annotated[int | None, typer.Option()] = None,
        real: Annotated[float, typer.Option()] = 0.5,
        limited: Annotated[int, typer.Option(min=1, max=5)] = 2,
        text: Annotated[str, typer.Option()] = "text",
        file: Annotated[Path | None, typer.Option()] = None,
        flag: Annotated[bool | None, typer.Option("--flag/--no-flag")] = None,
    ) -> None:
        print(repr((whole, real, limited, text, file, flag)))

    result = CliRunner().invoke(app, list(words))
    return result.exit_code, result.output


@pytest.mark.parametrize("option", ["--whole", "--real", "--limited", "--text", "--file"])
@pytest.mark.parametrize("text", NUMBERS)
def test_an_option_is_read_as_typer_reads_it(option: str, text: str) -> None:
    words = f"{option}={text}"
    assert output(LeanCommand, words) == output(typer.core.TyperCommand, words)


@pytest.mark.parametrize("words", [(), ("--flag",), ("--no-flag",), ("--help",), ("--other",)])
def test_what_is_not_typed_and_flags_are_as_typer_has_them(words: tuple[str, ...]) -> None:
    assert output(LeanCommand, *words) == output(typer.core.TyperCommand, *words)
