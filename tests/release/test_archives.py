"""What is released: the same bytes from every clone, and all that is committed."""

import os
import subprocess
import sys
import tarfile
import time
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# What a build writes into a source archive beside the committed files.
WRITTEN = {"PKG-INFO", "setup.cfg"}
METADATA = "cable_winding_twin.egg-info/"

pytestmark = [
    pytest.mark.campaign,
    pytest.mark.skipif(not (ROOT / ".git").exists(), reason="releases are built from a git clone"),
]


@dataclass(frozen=True, kw_only=True)
class Build:
    """What one clone's build left.

    Attributes:
        clone: The clone.
        archive: The source archive.
        wheel: The wheel.
    """

    clone: Path
    archive: Path
    wheel: Path


def run(words: Sequence[object], cwd: Path, *, umask: int = -1, **variables: str) -> str:
    """Return what a program prints; it must end well."""
    ended = subprocess.run(
        [str(word) for word in words],
        cwd=cwd,
        env={**os.environ, **variables},
        umask=umask,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


def build(clone: Path, *, umask: int, zone: str) -> Build:
    """Build a clone of the last commit under a mode mask and a time zone."""
    run(["git", "clone", "--quiet", ROOT, clone], clone.parent, umask=umask)
    # What an earlier build or an editor leaves is no part of a release.
    (clone / "ros2_ws" / "src" / "winding_core" / "winding_core" / "left_over.py").touch()
    run([clone / "release" / "build.sh", sys.executable, "dist"], clone, umask=umask, TZ=zone)
    (archive,), (wheel,) = (clone / "dist").glob("*.tar.gz"), (clone / "dist").glob("*.whl")
    return Build(clone=clone, archive=archive, wheel=wheel)


@pytest.fixture(scope="module")
def builds(tmp_path_factory: pytest.TempPathFactory) -> tuple[Build, Build]:
    """Return two builds of one commit: other folder, second, mode mask and time zone."""
    folder = tmp_path_factory.mktemp("release")
    first = build(folder / "one", umask=0o022, zone="UTC")
    began = int(time.time())
    while int(time.time()) == began:
        time.sleep(0.05)
    (folder / "elsewhere").mkdir()
    return first, build(folder / "elsewhere" / "two", umask=0o002, zone="Asia/Tokyo")


def test_two_clones_give_the_same_bytes(builds: tuple[Build, Build]) -> None:
    first, second = builds
    assert first.archive.name == second.archive.name
    assert first.archive.read_bytes() == second.archive.read_bytes()
    assert first.wheel.name == second.wheel.name
    assert first.wheel.read_bytes() == second.wheel.read_bytes()


def test_archives_bear_the_time_of_the_commit(builds: tuple[Build, Build]) -> None:
    committed = int(run(["git", "log", "-1", "--format=%ct"], ROOT))
    with tarfile.open(builds[0].archive) as archive:
        members = archive.getmembers()
    assert {member.mtime for member in members} == {committed}
    assert {(member.uid, member.gid, member.uname, member.gname) for member in members} == {
        (0, 0, "", "")
    }
    # A zip counts seconds by two.
    stamp = time.gmtime(committed)
    with zipfile.ZipFile(builds[0].wheel) as wheel:
        assert {item.date_time for item in wheel.infolist()} == {
            (*stamp[:5], stamp.tm_sec // 2 * 2)
        }


def test_the_source_archive_holds_every_committed_file(builds: tuple[Build, Build]) -> None:
    committed = set(run(["git", "ls-files"], builds[0].clone).splitlines())
    with tarfile.open(builds[0].archive) as archive:
        held = {member.name.partition("/")[2] for member in archive.getmembers() if member.isfile()}
    assert {name for name in held if not name.startswith(METADATA)} == committed | WRITTEN


def test_the_wheel_holds_every_module_and_the_licence(builds: tuple[Build, Build]) -> None:
    source = builds[0].clone / "ros2_ws" / "src"
    committed = run(["git", "ls-files", source], builds[0].clone).splitlines()
    modules = {
        "/".join(path.split("/")[3:])
        for path in committed
        if len(path.split("/")) > 4 and path.split("/")[2] == path.split("/")[3]
    }
    with zipfile.ZipFile(builds[0].wheel) as wheel:
        held = {name for name in wheel.namelist() if ".dist-info/" not in name}
        licences = [name for name in wheel.namelist() if name.endswith("licenses/LICENSE")]
    assert len(modules) > 300
    assert held == modules
    assert len(licences) == 1


def test_a_wheel_from_a_clone_is_the_one_from_the_source_archive(
    builds: tuple[Build, Build], tmp_path: Path
) -> None:
    committed = run(["git", "log", "-1", "--format=%ct"], ROOT).strip()
    clone = tmp_path / "clone"
    run(["git", "clone", "--quiet", ROOT, clone], tmp_path, umask=0o022)
    run(
        [sys.executable, "-m", "build", "--no-isolation", "--wheel", "--outdir", tmp_path, clone],
        tmp_path,
        umask=0o022,
        SOURCE_DATE_EPOCH=committed,
    )
    (wheel,) = tmp_path.glob("*.whl")
    assert wheel.read_bytes() == builds[0].wheel.read_bytes()
