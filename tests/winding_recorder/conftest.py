"""Recordings that tests look at, and copies that they harm."""

import shutil
from pathlib import Path

import pytest
from made_bags import Bags


@pytest.fixture(scope="session")
def bags() -> Bags:
    return Bags()


@pytest.fixture(scope="session")
def made(bags: Bags, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A whole recording of 0.6 s."""
    return bags.whole(tmp_path_factory.mktemp("made") / "bag")


@pytest.fixture
def copied(made: Path, tmp_path: Path) -> Path:
    """A copy of that recording, to be harmed."""
    return Path(shutil.copytree(made, tmp_path / "bag"))
