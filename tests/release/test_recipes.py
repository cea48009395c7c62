"""What pixi reads agrees with what pip reads."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
RECIPE = tomllib.loads((ROOT / "pixi.toml").read_text(encoding="utf-8"))


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
