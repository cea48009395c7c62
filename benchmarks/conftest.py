"""`bench` collects rows; the end of the session shows them and keeps them in bench.json."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from rich.console import Console

# Test modules are imported by path, without packages: their neighbours are found from here.
sys.path.insert(0, str(Path(__file__).parent))
from rows import SINGLE_THREAD, Bench, keep


def pytest_configure(config: pytest.Config) -> None:
    os.environ.update(SINGLE_THREAD)


@pytest.fixture(scope="session")
def session_bench() -> Iterator[Bench]:
    """Rows of this session, kept and printed at its end."""
    rows = Bench()
    yield rows
    keep(rows.rows.values())
    console = Console(width=None if sys.stdout.isatty() else 140)
    console.print()
    console.print(rows.table())


@pytest.fixture
def bench(session_bench: Bench) -> Iterator[Bench]:
    """Rows of this test: `bench.row(name, value, unit, bar=None)`; its end judges all bars."""
    rows = Bench()
    yield rows
    session_bench.rows |= rows.rows
    missed = [f"\n{row}" for row in rows.rows.values() if not row.met]
    assert not missed, "".join(missed)
