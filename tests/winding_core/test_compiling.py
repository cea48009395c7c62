"""Machine code on disk: never of other sources, kept while it holds, only the user's own."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

INNER = '''
from winding_core.compiling import compiled

FACTOR = {factor}


def unrelated(value={default}):
    """{docstring}."""
    return value


@compiled
def scaled(x):
    return FACTOR * x
'''
OUTER = """
from kernels.inner import scaled
from winding_core.compiling import compiled


@compiled
def outer(x):
    return scaled(x) + 1.0
"""
ASK = """
import warnings

from winding_core.compiling import is_compiled

with warnings.catch_warnings(record=True) as warned:
    from kernels.deeper.outer import outer

    ready = is_compiled("kernels")
value = outer(10.0)
hits = sum(outer.stats.cache_hits.values()) if hasattr(outer, "stats") else 0
print(value, hits, ready, *[w.message for w in warned], sep="|")
"""

NAMED = """
from winding_core.compile_progress import PROGRESS
from kernels.deeper.outer import outer

with PROGRESS.heard(lambda item: print(item and f"{item.share} {item.kernel}", end="|")):
    outer(10.0)
    outer(11.0)
"""


class Checkout:
    """A package whose kernel calls one of another file, and a cache folder."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.cache = folder, folder / "cache"
        self.inner = folder / "kernels" / "inner.py"
        deeper = self.inner.parent / "deeper"
        deeper.mkdir(parents=True)
        (self.inner.parent / "__init__.py").touch()
        (deeper / "outer.py").write_text(OUTER, encoding="utf-8")
        self.write()

    def write(self, factor: int = 2, default: int = 1, docstring: str = "Text") -> None:
        content = INNER.format(factor=factor, default=default, docstring=docstring)
        self.inner.write_text(content, encoding="utf-8")

    def ask(self, script: str = ASK, **environment: str) -> list[str]:
        """Return what a process prints.

        Usually outer(10), hits of its code on disk, whether all is compiled, and warnings.
        """
        path = os.pathsep.join([str(self.folder), *sys.path])
        given = {"PYTHONPATH": path, "NUMBA_CACHE_DIR": str(self.cache), **environment}
        # Python compares its own code by the second.
        given["PYTHONDONTWRITEBYTECODE"] = "1"
        done = subprocess.run(
            [sys.executable, "-c", script], env={**os.environ, **given},
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        return done.stdout.strip().split("|")


@pytest.fixture
def checkout(tmp_path: Path) -> Checkout:
    return Checkout(tmp_path)


@pytest.mark.slow
def test_only_what_a_kernel_reaches_compiles_it_again(checkout: Checkout) -> None:
    assert checkout.ask() == ["21.0", "0", "False"]
    checkout.write(default=3, docstring="Next")
    assert checkout.ask()[:2] == ["21.0", "1"]
    checkout.write(factor=3)
    assert checkout.ask() == ["31.0", "0", "False"]
    assert checkout.ask() == ["31.0", "1", "True"]


@pytest.mark.slow
def test_kernels_are_named_once_as_they_are_compiled(checkout: Checkout) -> None:
    both = ["1 of 2 kernels.deeper.outer.outer", "2 of 2 kernels.inner.scaled", "None", ""]
    assert checkout.ask(NAMED) == both
    assert checkout.ask(NAMED) == [""]
    checkout.write(factor=4)
    assert checkout.ask(NAMED) == both


@pytest.mark.slow
def test_code_goes_to_the_users_own_folder_without_the_variable(checkout: Checkout) -> None:
    home = checkout.folder / "home"
    assert checkout.ask(NUMBA_CACHE_DIR="", XDG_CACHE_HOME=str(home)) == ["21.0", "0", "False"]
    root = home / "winding-kernels"
    assert root.stat().st_mode & 0o777 == 0o700
    assert {path.name.partition("-")[0] for path in root.iterdir()} == {
        "kernels.inner.scaled",
        "kernels.deeper.outer.outer",
    }


@pytest.mark.slow
@pytest.mark.parametrize(
    ("broken", "reason"),
    [
        ("a file", "Not a directory"),
        ("writable root", "winding-kernels belongs to another user, or others may write to it"),
        ("writable kernel", r"outer-\w+ belongs to another user, or others may write to it"),
        ("linked kernel", r"outer-\w+ is a link, which is not followed"),
        ("kernel of another user", r"outer-\w+ belongs to another user"),
        ("code of another user", r"\.nbi belongs to another user"),
    ],
)
def test_an_unusable_cache_is_a_warning(checkout: Checkout, broken: str, reason: str) -> None:
    root = checkout.cache / "winding-kernels"
    if broken == "a file":
        checkout.cache.write_text("")
    else:
        checkout.ask()
        assert checkout.ask()[1] == "1"
        (kernel,) = root.glob("kernels.deeper.outer.outer-*")
        if broken == "writable root":
            root.chmod(0o775)
        elif broken == "writable kernel":
            kernel.chmod(0o722)
        elif broken == "linked kernel":
            kernel.rename(checkout.folder / "elsewhere")
            kernel.symlink_to(checkout.folder / "elsewhere")
        elif os.geteuid() != 0:
            pytest.skip("only root gives files to another user")
        else:
            given = kernel if broken.startswith("kernel") else next(kernel.rglob("*.nbi"))
            os.chown(given, 65534, 65534)
    value, hits, _, warning = checkout.ask()
    assert (value, hits) == ("21.0", "0")
    assert "every process compiles its kernels anew: " in warning
    assert re.search(reason, warning)


def test_without_a_compiler_kernels_are_plain_python(checkout: Checkout) -> None:
    assert checkout.ask(NUMBA_DISABLE_JIT="1") == ["21.0", "0", "True"]
    assert not checkout.cache.exists()


@pytest.mark.slow
def test_code_that_no_process_loads_is_removed_when_other_code_is_made(checkout: Checkout) -> None:
    root = checkout.cache / "winding-kernels"
    unused, used = root / "kernels.gone-1", root / "other.used-2"
    for folder, days in ((unused, 31), (used, 29)):
        folder.mkdir(mode=0o700, parents=True)
        age = folder.stat().st_mtime - days * 24 * 3600
        os.utime(folder, (age, age))
    root.chmod(0o700)
    checkout.ask()
    assert not unused.exists()
    assert used.exists()
