"""The library of cables: what a run takes of one, and what is refused."""

from pathlib import Path

import pytest

from winding_core.catalogue.cables import (
    PROPERTIES,
    CableError,
    cables,
    find_cable,
    own_folder,
    read_cable,
)
from winding_core.run_spec import RunSpec

HOSE = """\
cable: {title: A hose}
properties: {cable_diameter_mm: 12, young_mpa: 4.5, poisson: 0.49}
uncertainty: {young_mpa: 0.2}
winding: {cylinder_diameter_mm: 250, tension_n: 25, omega_rad_s: 1}
"""


@pytest.fixture
def library(tmp_path: Path) -> Path:
    (tmp_path / "mine.yaml").write_text(HOSE, encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize("cable", cables().values(), ids=lambda cable: cable.name)
def test_a_shipped_cable_has_sources_and_can_be_wound(cable: object) -> None:
    found = find_cable(cable.name)  # type: ignore[attr-defined]
    assert found.path is None
    assert found.sources["young_mpa"]
    assert {"cable_diameter_mm", "young_mpa", "density"} <= found.uncertainty.keys()
    wound = RunSpec.from_cell(None, {"cable": found.name})
    assert wound.condition.young == pytest.approx(1.0e6 * found.properties["young_mpa"])
    assert wound.labels["cable"] == found.name


def test_what_is_stated_beside_a_cable_wins(library: Path) -> None:
    named = {"cable": "mine", "library": str(library)}
    trial = RunSpec.from_cell(None, named).condition
    assert (trial.young, trial.weight, trial.cylinder_diameter) == (4.5e6, 25.0, 0.25)
    other = RunSpec.from_cell(None, {**named, "young_mpa": 3.0, "tension_mpa": 0.1}).condition
    assert (other.young, other.weight, other.nominal_stress) == (3.0e6, 0.0, 1.0e5)
    # Another cylinder is another winding: nothing of the trial is taken.
    own = {**named, "cylinder_diameter_mm": 80, "tension_n": 5}
    assert RunSpec.from_cell(None, own).condition.angular_speed == pytest.approx(1.74)
    case = RunSpec.from_cell(None, {**named, "case": 4}).condition.resolved().case
    assert (case.cylinder_diameter, case.cable_diameter) == (0.03, 0.012)


def test_a_typed_cable_wins_over_the_properties_of_a_cell_file(library: Path) -> None:
    cell = library / "left.cell"
    cell.write_text("condition: {case: 4, young_mpa: 2.2, friction: 0.3}\n", encoding="utf-8")
    spec = RunSpec.from_cell(cell, {"cable": str(library / "mine.yaml")})
    assert (spec.condition.young, spec.condition.friction) == (4.5e6, 0.3)
    cell.write_text(f"{cell.read_text()}run: {{cable: {library}/mine.yaml}}\n", encoding="utf-8")
    assert RunSpec.from_cell(cell, {}).condition.young == 2.2e6


def test_a_file_is_read_as_it_was_written(library: Path) -> None:
    cable = read_cable(library / "mine.yaml")
    (library / "copy.yaml").write_text(cable.text(), encoding="utf-8")
    copy = read_cable(library / "copy.yaml")
    assert (copy.properties, copy.winding) == (cable.properties, cable.winding)
    assert {"cable_diameter_mm", "law", "mooney_ratio", "prony"} <= {*PROPERTIES}


def test_own_cables_lie_in_the_users_data(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    folder = tmp_path / "cable-winding-twin" / "cables"
    assert own_folder() == folder
    folder.mkdir(parents=True)
    (folder / "coaxial.yaml").write_text(HOSE, encoding="utf-8")
    assert find_cable("coaxial").title == "A hose"
    monkeypatch.setenv("XDG_DATA_HOME", "here")
    assert own_folder() == Path.home() / ".local" / "share" / "cable-winding-twin" / "cables"


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("young_mpa: 4.5", "young_mpa: -4.5", "line 2, column 48: young_mpa must be positive"),
        ("young_mpa: 4.5, ", "", "uncertainty of young_mpa needs a number"),
        ("poisson: 0.49", "posson: 0.49", "section properties has no parameter posson; did you"),
        ("properties:", "props:", "a cable file has no parameter props; did you"),
        ("young_mpa: 0.2", "young_mpa: 0", "must be a positive number, got 0 of young_mpa"),
        ("young_mpa: 0.2", "density: 2", "uncertainty of density needs a number density"),
        ("tension_n: 25", "tension_n: .nan", "line 4, column 49: tension_n must be finite"),
        ("A hose", "7", "title must be a text, got 7"),
        ("cable_diameter_mm: 12, ", "", "a cable needs cable_diameter_mm and young_mpa"),
    ],
)
def test_a_wrong_file_is_refused_by_place(library: Path, old: str, new: str, sentence: str) -> None:
    file = library / "mine.yaml"
    file.write_text(HOSE.replace(old, new), encoding="utf-8")
    with pytest.raises(CableError) as refused:
        find_cable("mine", library)
    assert sentence in str(refused.value)
    assert str(refused.value).startswith(f"{file}, line ")


def test_what_is_not_there_is_refused(library: Path) -> None:
    for name, sentence in (
        ("coaxal", "did you mean coaxial"),
        ("nothing like it", "`winding cable list` shows all"),
        ("gone.yaml", "there is no cable file gone.yaml"),
    ):
        with pytest.raises(ValueError, match=sentence):
            RunSpec.from_cell(None, {"cable": name})
    with pytest.raises(CableError, match="no folder of cables"):
        cables(library / "none")
    with pytest.raises(ValueError, match="batch must be printable and at most 200"):
        RunSpec.from_cell(None, {"case": 4, "batch": "x" * 201})
