"""The `winding` command in this process, and what it writes held against its schema."""

import contextlib
import json
from importlib.resources import files
from pathlib import Path
from typing import Any

from jsonschema import Draft202012Validator
from typer.testing import CliRunner, Result

from winding_cli.app import app


def winding(folder: Path, *words: object, code: int | None = None) -> Result:
    """Run a command in a folder; where an exit code is given, it must end with that."""
    with contextlib.chdir(folder):
        done = CliRunner().invoke(app, [*map(str, words)])
    assert code in (None, done.exit_code), done.output
    return done


def schema(name: str, package: str = "winding_cli") -> Draft202012Validator:
    text = (files(package) / "schemas" / f"{name}.json").read_text(encoding="utf-8")
    return Draft202012Validator(json.loads(text))


def keeps_schema(name: str, text: str | bytes) -> Any:
    """Return the content of JSON that keeps its schema."""
    content = json.loads(text)
    assert [error.message for error in schema(name).iter_errors(content)] == []
    return content
