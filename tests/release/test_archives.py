"""What is released: the same bytes from every clone, and all that is committed."""

import re
import sys
import tarfile
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
# What a build writes into a source archive beside the committed files.
WRITTEN = {"PKG-INFO", "setup.cfg"}
METADATA = "cable_winding_twin.egg-info/"

pytestmark = pytest.mark.campaign


def test_two_clones_give_the_same_bytes(builds: Any) -> None:
    first, second = builds
    assert first.archive.name == second.archive.name
    assert first.archive.read_bytes() == second.archive.read_bytes()
    assert first.wheel.name == second.wheel.name
    assert first.wheel.read_bytes() == second.wheel.read_bytes()


def test_archives_bear_the_time_of_the_commit(first_build: Any, run: Callable[..., str]) -> None:
    committed = int(run(["git", "log", "-1", "--format=%ct"], ROOT))
    with tarfile.open(first_build.archive) as archive:
        members = archive.getmembers()
    assert {member.mtime for member in members} == {committed}
    assert {(member.uid, member.gid, member.uname, member.gname) for member in members} == {
        (0, 0, "", "")
    }
    # A zip counts seconds by two.
    stamp = time.gmtime(committed)
    with zipfile.ZipFile(first_build.wheel) as wheel:
        assert {item.date_time for item in wheel.infolist()} == {
            (*stamp[:5], stamp.tm_sec // 2 * 2)
        }


def test_the_source_archive_holds_every_committed_file(first_build: Any, run: Any) -> None:
    committed = set(run(["git", "ls-files"], first_build.clone).splitlines())
    with tarfile.open(first_build.archive) as archive:
        held = {member.name.partition("/")[2] for member in archive.getmembers() if member.isfile()}
    assert {name for name in held if not name.startswith(METADATA)} == committed | WRITTEN


def test_the_wheel_holds_every_module_and_the_licence(first_build: Any, run: Any) -> None:
    source = first_build.clone / "ros2_ws" / "src"
    committed = run(["git", "ls-files", source], first_build.clone).splitlines()
    modules = {
        "/".join(path.split("/")[3:])
        for path in committed
        if len(path.split("/")) > 4 and path.split("/")[2] == path.split("/")[3]
    }
    with zipfile.ZipFile(first_build.wheel) as wheel:
        held = {name for name in wheel.namelist() if ".dist-info/" not in name}
        licences = [name for name in wheel.namelist() if name.endswith("licenses/LICENSE")]
    assert len(modules) > 300
    assert held == modules
    assert len(licences) == 1


def test_the_index_reads_a_description_without_relative_links(first_build: Any) -> None:
    with zipfile.ZipFile(first_build.wheel) as wheel:
        (name,) = (name for name in wheel.namelist() if name.endswith("/METADATA"))
        metadata = wheel.read(name).decode()
    links = re.findall(r"\]\(([^)]+)\)", metadata)
    assert len(links) > 10
    assert [link for link in links if not link.startswith(("https://", "#"))] == []


def test_a_wheel_from_a_clone_is_the_archive_s(first_build: Any, run: Any, tmp_path: Path) -> None:
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
    assert wheel.read_bytes() == first_build.wheel.read_bytes()
