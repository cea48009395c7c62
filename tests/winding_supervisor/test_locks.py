"""A lock is the user's own: no link is followed, nothing of another user's is opened or changed."""

import os
import re
from pathlib import Path

import pytest

from winding_supervisor.session import domain_lock as locks
from winding_supervisor.session.domain_lock import DomainError, domain_lock, server_lock

NAME = "domain-17-cell-a.lock"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    own = tmp_path / "locks"
    monkeypatch.setattr(locks, "lock_folder", lambda: own)
    return own


# What stands in the place of the folder or of the file, and its mode.
PLANTED = [
    ("linked file", f"{NAME} cannot be held: .*; no link is followed"),
    ("linked folder", f"{NAME} cannot be held: .*; no link is followed"),
    ("file for a folder", f"{NAME} cannot be held: "),
    ("open folder", "locks has mode 0773: others may write to it"),
    ("open file", f"{NAME} has mode 0622: others may write to it"),
    ("pipe", f"{NAME} is no file"),
]


@pytest.mark.parametrize(("planted", "sentence"), PLANTED)
def test_a_planted_lock_is_refused_and_nothing_is_changed(
    folder: Path, planted: str, sentence: str
) -> None:
    precious = folder.parent / "precious"
    precious.write_text("kept")
    if planted == "linked folder":
        folder.symlink_to(folder.parent)
    elif planted == "file for a folder":
        folder.touch()
    else:
        folder.mkdir(0o700)
    if planted == "linked file":
        (folder / NAME).symlink_to(precious)
    elif planted == "open folder":
        folder.chmod(0o773)
    elif planted == "open file":
        (folder / NAME).touch()
        (folder / NAME).chmod(0o622)
    elif planted == "pipe":
        os.mkfifo(folder / NAME, 0o600)
    with pytest.raises(DomainError, match=sentence), domain_lock(17, "cell/a"):
        pytest.fail("it was held")
    assert precious.read_text() == "kept"


@pytest.mark.skipif(os.geteuid() != 0, reason="only root gives files to another user")
@pytest.mark.parametrize("what", ["locks", f"locks/{NAME}"])
def test_a_lock_of_another_user_is_refused(folder: Path, what: str) -> None:
    folder.mkdir(0o700)
    (folder / NAME).touch(0o600)
    os.chown(folder.parent / what, 4321, 4321)
    with (
        pytest.raises(DomainError, match=re.escape(f"{what} belongs to user 4321")),
        domain_lock(17, "cell/a"),
    ):
        pytest.fail("it was held")


def test_a_graph_and_a_server_of_goals_hold_a_namespace_once_each(folder: Path) -> None:
    with domain_lock(17, "cell/a"), server_lock(17, "cell/a"), domain_lock(17, "cell/b"):
        for lock, what in ((domain_lock, "runs a graph"), (server_lock, "has a server of goals")):
            with (
                pytest.raises(DomainError, match=f"DDS domain 17 already {what} in namespace /c"),
                lock(17, "cell/a"),
            ):
                pytest.fail("it was held twice")
    assert folder.stat().st_mode & 0o777 == 0o700
    with server_lock(17, "cell/a"):
        pass
