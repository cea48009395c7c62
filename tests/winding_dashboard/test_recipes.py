"""Recipes of the page: cell files that are saved, filled in again, and refused."""

from pathlib import Path

import pytest
from simulated_page import OWN_FIELDS, at_desk, form

from winding_core.run_spec import RunSpec


@pytest.mark.parametrize(
    "typed",
    [
        form(9, "hencky", friction=0.21),
        form(0, **{**OWN_FIELDS, "tension_n": 7.25}, duration_s=33.5),
        form(3, "linear"),
    ],
)
def test_recipe_is_a_cell_file_that_fills_the_form_again(tmp_path: Path, typed: dict) -> None:
    desk = at_desk(runs=tmp_path)
    assert desk.look()["parts"]["recipes"].strip() == ""
    assert desk.ask("/recipe/save", name="Red fibre 2", form=typed).endswith("Red fibre 2 is kept")
    file = tmp_path / "recipes" / "Red fibre 2.yaml"
    spec = RunSpec.from_cell(file, {})
    assert (spec.condition.case, spec.condition.law) == (typed["case"], typed["law"])
    assert spec.text() == file.read_text(encoding="utf-8")
    assert 'value="Red fibre 2"' in desk.look()["parts"]["recipes"]
    seen = desk.look()
    body = {"server": seen["server"], "sequence": seen["sequence"], "name": "Red fibre 2"}
    loaded = desk.request("POST", "/recipe/load", json=body).json()["form"]
    assert loaded == {key: typed[key] for key in ("case", "law", "fields")}
    assert desk.graph.done == []


def test_recipe_of_a_whole_run_names_what_the_page_leaves(tmp_path: Path) -> None:
    (tmp_path / "recipes").mkdir()
    (tmp_path / "recipes" / "cell.yaml").write_text(
        "condition:\n  case: 6\nmachine:\n  seed: 17\nlimits:\n  error_limit_pct: 2.2\n"
    )
    answer = at_desk(runs=tmp_path).ask("/recipe/load", name="cell")
    assert answer.endswith("form; not seed, error_limit_pct, which the run has already")


@pytest.mark.parametrize(
    ("path", "name", "sentence"),
    [
        ("save", "taken", "there is a recipe taken already"),
        ("save", "../../run", "a name has 1 to 60 letters"),
        ("save", "", "a name has 1 to 60 letters"),
        ("load", "none", "there is no recipe none"),
        ("load", "/etc/passwd", "a name has 1 to 60 letters"),
        ("load", "taken", "taken.yaml, line 3, column 13: friction must be"),
    ],
)
def test_recipe_that_cannot_be_is_refused_and_none_is_written_over(
    tmp_path: Path, path: str, name: str, sentence: str
) -> None:
    (tmp_path / "recipes").mkdir()
    file = tmp_path / "recipes" / "taken.yaml"
    file.write_text(text := "condition:\n  case: 5\n  friction: -8\n")
    desk = at_desk(runs=tmp_path)
    assert sentence in desk.ask(f"/recipe/{path}", name=name, form=form(2))
    assert desk.look()["alarm"]
    assert file.read_text() == text
    assert [item.name for item in tmp_path.rglob("*.yaml")] == ["taken.yaml"]


def test_refused_condition_is_no_recipe_and_a_page_without_runs_keeps_none(tmp_path: Path) -> None:
    wrong = form(0, **{**OWN_FIELDS, "cylinder_diameter_mm": 7000})
    answer = at_desk(runs=tmp_path).ask("/recipe/save", name="wrong", form=wrong)
    assert "Cylinder diameter, mm must be at most 2000, got 7000" in answer
    assert not (tmp_path / "recipes").exists()
    desk = at_desk()
    assert desk.look()["hidden"]["recipe-row"]
    assert "no folder of runs" in desk.ask("/recipe/save", name="fine", form=form(4))
