"""`winding cable`: cables are listed, compared, added and wound."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from in_process import keeps_schema, winding

from winding_core.catalogue.cables import find_cable


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    return tmp_path


@pytest.mark.parametrize("words", [("list",), ("show", "hose"), ("compare", "hose", "tube")])
def test_what_is_written_keeps_its_schema(home: Path, words: tuple[str, ...]) -> None:
    done = winding(home, "cable", *words, "--json", "-")
    assert done.exit_code == 0, done.output
    content = keeps_schema("cables", done.stdout)
    assert len(content["cables"]) == {"list": 10, "show": 1, "compare": 2}[words[0]]


def test_an_identified_cable_is_added_shown_and_wound(home: Path) -> None:
    record = {
        "law": "hencky", "young_pa": 4.1e6, "standard_error_pa": 2.0e4, "half_width_90_pa": 4.0e4,
        "refused": "",
    }  # fmt: skip
    (home / "found.json").write_text(json.dumps(record), encoding="utf-8")
    words = ("cable", "add", "left", "--like", "hose", "--identified", "found.json")
    done = winding(home, *words, "--poisson", 0.48, "--source", "sheet")
    assert done.exit_code == 0, done.output
    left = find_cable("left")
    assert (left.properties["young_mpa"], left.uncertainty["young_mpa"]) == (4.1, 0.02)
    assert (left.properties["law"], left.properties["poisson"]) == ("hencky", 0.48)
    assert (left.sources["young_mpa"], left.sources["poisson"]) == (
        "winding identify, found.json", "sheet"
    )  # fmt: skip
    again = winding(home, *words)
    assert (again.exit_code, "exists already; --force replaces it" in again.stderr) == (2, True)
    shown = winding(home, "cable", "show", "left").stdout
    assert "winding identify, found.json" in shown
    assert winding(home, "predict", "--cable", "left", "--check").exit_code == 0
    done = winding(home, "cable", "compare", "left", "hose", "--json", "-")
    # 0.409 MPa of difference, 0.02 and 1.1 MPa of deviation.
    apart = json.loads(done.stdout)["deviations_apart"]["young_mpa"]
    assert apart == pytest.approx(0.37, abs=0.03)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("cable", "show", "coaxal"), "the library has no cable 'coaxal'; did you mean coaxial?"),
        (("cable", "add", "a/b", "--young-mpa", 2), "a cable's name is of letters"),
        (("cable", "add", "new", "--young-mpa", 2), "a cable needs cable_diameter_mm and young"),
        (("cable", "add", "new", "--like", "hose", "--young-mpa", -2), "--young-mpa must be posit"),
        (("cable", "add", "new", "--like", "hose", "--uncertainty", "young"), "--uncertainty must"),
        (("cable", "add", "new", "--identified", "refused.json"), "refused.json must not be used"),
        (("cable", "add", "new", "--identified", "empty.json"), "empty.json is no result of"),
        (("cable", "add", "new", "--identified", "none.json"), "none.json cannot be read"),
        (("predict", "--cable", "coaxal"), "the library has no cable"),
        (("plan", "--cable", "gone.yaml", "--even"), "there is no cable file gone.yaml"),
        (("run", "--cable", "coaxal"), "the library has no cable"),
        (("cable", "list", "--library", "nowhere"), "there is no folder of cables nowhere"),
    ],
)
def test_wrong_input_is_one_sentence(home: Path, words: tuple[object, ...], sentence: str) -> None:
    (home / "refused.json").write_text('{"refused": "P3 is missed by 7 %"}', encoding="utf-8")
    (home / "empty.json").write_text("{}", encoding="utf-8")
    done = winding(home, *words)
    assert done.exit_code == 2, done.output
    assert done.stderr.startswith(f"winding: {sentence}")
    assert done.stderr.count("\n") == 1
