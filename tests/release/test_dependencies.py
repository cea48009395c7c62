"""Dependencies: licences as the libraries state them, and the same versions for pixi and pip."""

import re
import tomllib
from pathlib import Path
from types import ModuleType

import pytest
from packaging.utils import canonicalize_name
from script import script

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "licences.md").read_text(encoding="utf-8")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
RECIPE = tomllib.loads((ROOT / "pixi.toml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def licences() -> ModuleType:
    return script(ROOT / "release" / "licences.py")


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


def extras(feature: dict[str, dict[str, dict[str, list[str]]]]) -> set[str]:
    """Return the extras of the project that a feature installs."""
    (name,) = feature["pypi-dependencies"]
    assert name == PROJECT["name"]
    return set(feature["pypi-dependencies"][name]["extras"])


def test_the_recipe_names_the_project_and_its_pythons() -> None:
    assert RECIPE["workspace"]["name"] == PROJECT["name"]
    wanted = RECIPE["dependencies"]["python"]
    assert set(wanted.split(",")) == set(PROJECT["requires-python"].split(","))


def test_the_recipe_s_extras_are_those_of_a_run_and_of_users() -> None:
    assert extras(RECIPE) == {"ros"}
    users = set(PROJECT["optional-dependencies"]) - {"dev", "docs", "peers"}
    assert extras(RECIPE["feature"]["whole"]) == users
    assert RECIPE["environments"]["whole"] == ["whole"]
