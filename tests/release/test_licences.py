"""The page of licences names what the project depends on, as the installed libraries state it."""

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "licences.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def licences() -> ModuleType:
    """Return the script that writes the page."""
    spec = importlib.util.spec_from_file_location("licences", ROOT / "release" / "licences.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def listed(section: str) -> dict[str, tuple[str, str]]:
    """Return licence and extra by library of one table of the page."""
    text = PAGE.split(f"## {section}\n")[1].split("\n## ")[0]
    rows = re.findall(r"^\| (.+?) \| (.+) \| (.+?) \|$", text, re.MULTILINE)
    return {canonicalize_name(name): (licence, extra) for name, licence, extra in rows[1:]}


def test_every_direct_dependency_is_listed_as_it_states_itself(licences: ModuleType) -> None:
    rows = listed("Named by the project")
    project = licences.PROJECT
    optional = project["optional-dependencies"]
    texts = [*project["dependencies"], *(one for part in licences.EXTRAS for one in optional[part])]
    assert rows.keys() == licences.required(texts).keys()
    for name, (licence, _) in rows.items():
        assert licence == licences.licence_of(licences.metadata.distribution(name)), name


def test_every_extra_of_users_is_looked_at(licences: ModuleType) -> None:
    extras = set(licences.PROJECT["optional-dependencies"])
    assert extras - set(licences.EXTRAS) == {"dev", "docs", "peers"}


def test_copyleft_is_named_first(licences: ModuleType) -> None:
    everything = listed("Named by the project") | listed("Brought by these")
    weak = {name for name, (licence, _) in everything.items() if licences.COPYLEFT.search(licence)}
    assert "asyncua" in weak
    assert listed("Copyleft").keys() == weak
