import csv
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from correction_node.models.dataset import lengths
from correction_node.models.factor_models import ProcessModel
from correction_node.models.own_runs import OWN_COLUMNS, load_own_runs
from correction_node.models.place import PlaceModel, measured_places
from correction_node.models.weights import TrainedFactor, load_factor, save_factor
from correction_node.training.protocol import learn_own
from correction_node.training.training import OWN, TrainingConfig
from winding_core.cable.cases import Case, Material
from winding_core.helix import PAPER_FREE_LENGTH, FleetAngleLaw
from winding_core.lay.quasi_static import QuasiStaticLay
from winding_core.machine.drive import DriveProfile
from winding_core.machine.tension import DeadWeight, RigTension

# The tracker's of one frame on a thin and a thick cylinder.
SIGMA_THETA, SIGMA_Z = 2.0e-3, 1.0e-4
STATED = Material()


def hidden_runs(
    seed: int, runs: int = 10, stated: float = STATED.young
) -> list[dict[str, float | str]]:
    """Return rows of runs of one hidden cable on one hidden rig, predicted as stated."""
    draw = np.random.default_rng(seed)
    cable = draw.choice([2.0e-3, 3.0e-3, 4.0e-3])
    cylinder = draw.choice([30.0e-3, 45.0e-3, 60.0e-3])
    young = stated * np.exp(draw.choice([-1.0, 1.0]) * draw.uniform(0.35, 0.7))
    law = draw.choice(["linear", "neo_hookean"])
    free_length = draw.uniform(0.16, 0.24)
    rig = RigTension(
        weight_share=draw.uniform(0.7, 0.9),
        offset=draw.uniform(0.0, 0.1),
        start_share=draw.uniform(0.4, 1.0),
        build_up_length=draw.uniform(0.05, 0.4),
    )
    area = 0.25 * np.pi * cable**2
    weights = area * stated * np.array([0.1, 0.17, 0.25])
    rows: list[dict[str, float | str]] = []
    for run in range(runs):
        case = Case(
            cylinder_diameter=cylinder,
            cable_diameter=cable,
            weight=weights[run % 3],
            marker_spacing=np.pi * cylinder,
            material=Material(young=stated),
        )
        predicted = QuasiStaticLay(case, "linear").curve_lengths(DeadWeight())
        true = QuasiStaticLay(replace(case, material=Material(young=young)), str(law))
        theta = true.theta(replace(rig, weight_share=rig.weight_share * draw.normal(1.0, 5e-3)))
        z = FleetAngleLaw(
            advance_per_radian=DriveProfile().advance_per_radian,
            free_length=free_length,
            radius=case.centreline_radius,
        ).z(theta)
        theta += draw.normal(0.0, SIGMA_THETA, theta.shape)
        z += draw.normal(0.0, SIGMA_Z, z.shape)
        for n in range(case.marker_count):
            values = (f"r{run}", n + 1, cylinder, cable, case.weight, case.marker_spacing,
                      stated, predicted[n], theta[n], z[n])  # fmt: skip
            row = dict(zip(OWN_COLUMNS, values, strict=True))
            rows.append({**row, "sigma_theta": SIGMA_THETA, "sigma_z": SIGMA_Z})
    return rows


def write(path: Path, rows: list[dict[str, float | str]]) -> Path:
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    return path


def learned(folder: Path, rows: list[dict[str, float | str]]) -> Any:
    return learn_own(load_own_runs(write(folder / "runs.csv", rows)), lambda _: None)


def kept(folder: Path, factor: TrainedFactor) -> TrainedFactor:
    """Return weights as they come back from files."""
    save_factor(factor, folder / "weights")
    return load_factor(folder / "weights")


def case_of(row: dict[str, float | str]) -> Case:
    names = ("cylinder_diameter", "cable_diameter", "marker_spacing")
    return Case(weight=float(row["weight_n"]), **{name: float(row[f"{name}_m"]) for name in names})


def left_out(path: Path) -> Iterator[tuple[float, float, bool]]:
    """Yield raw and corrected errors [%], and whether the interval held, of runs left out."""
    cells = load_own_runs(path).cells
    for run in (1, 5, 9):  # One under each tension
        known = [cell for cell in cells if cell.case != run]
        asked = [cell for cell in cells if cell.case == run]
        (model,) = OWN.learn_all([known], TrainingConfig(), [0])
        assert isinstance(model, ProcessModel)
        s_fem, s_exp = lengths(asked)
        off = np.abs(s_exp / (model.h(asked) * s_fem) - 1.0)
        raw = np.abs(s_exp / s_fem - 1.0)
        yield from zip(100.0 * raw, 100.0 * off, (off <= model.bounds(asked)).tolist(), strict=True)


def test_forty_hidden_cables_are_learned_from_ten_runs_each(tmp_path: Path) -> None:
    raw, corrected, inside = (
        np.array(column)
        for column in zip(
            *(
                row
                for seed in range(40)
                for row in left_out(write(tmp_path / "runs.csv", hidden_runs(seed)))
            ),
            strict=True,
        )
    )
    assert raw.mean() >= 3.0
    # Asked: 0.5 % in the mean, 90 % intervals that hold in 90 +- 4 %.
    assert corrected.mean() <= 0.5
    assert abs(100.0 * inside.mean() - 90.0) <= 4.0, 100.0 * inside.mean()


def test_a_second_cable_is_outside(tmp_path: Path) -> None:
    rows = hidden_runs(3)
    factor = kept(tmp_path, learned(tmp_path, rows).factor)
    cell = load_own_runs(tmp_path / "runs.csv").cells[3]
    case = case_of(rows[3])
    known = factor.factor(case)
    assert known.outside is None
    # Raw predictions are 3 % off and more; those of the fit's own runs are within its interval.
    assert abs(known.by_marker[3] * cell.s_fem / cell.s_exp - 1.0) <= known.bounds[3]
    for other in (
        replace(case, material=Material(young=1.3 * STATED.young)),
        replace(case, cable_diameter=1.2 * case.cable_diameter),
        replace(case, weight=3.0 * case.weight),
    ):
        found = factor.factor(other)
        assert found.outside
        assert set(found.by_marker) == {1.0}
        assert found.relative_bound > known.relative_bound


def test_places_of_runs_left_out_are_learned_with_their_lengths(tmp_path: Path) -> None:
    factor = learned(tmp_path, hidden_runs(5)).factor
    data, found = load_own_runs(tmp_path / "runs.csv"), factor.card["place"]["left_out"]
    conditions, (theta, z) = list(data.cells), measured_places(data.cells)
    raw = PlaceModel(free_length=PAPER_FREE_LENGTH, process=None)
    off = raw.place(conditions, lengths(conditions)[0])
    assert np.abs(off[1] - z).mean() >= 1.0e-3
    assert np.abs(off[0] - theta).mean() >= 0.1
    # The mean of |error| is 0.8 of the tracker's deviations; twice that, as nine runs teach it.
    assert 1.0e-3 * found["z_mm"] <= 1.6 * SIGMA_Z
    assert found["theta_rad"] <= 0.02
    place = kept(tmp_path, factor).place
    again = place.place(conditions, lengths(conditions)[1])[1]
    assert np.abs(again - z).mean() <= 1.6 * SIGMA_Z


def two_cables(stated: float) -> list[dict[str, float | str]]:
    """Return runs of two cables of equal size; of the second a modulus [Pa] is configured."""
    return [
        {**row, "run": f"{cable}{row['run']}", "cable": cable}
        for cable, seed, young in (("hose", 4, STATED.young), ("tube", 5, stated))
        for row in hidden_runs(seed, stated=young)
    ]


def test_cables_are_learned_together_and_one_left_out_is_not_known(tmp_path: Path) -> None:
    rows = two_cables(2.0 * STATED.young)
    factor = learned(tmp_path, rows).factor
    card = factor.card
    assert card["cables"] == ["hose", "tube"]
    assert card["errors"]["process"]["leave_one_case_out_pct"] <= 0.5
    assert abs(card["inside_90_run_left_out_pct"] - 90.0) <= 10.0
    # Ten runs of one cable tell nothing of the hidden modulus of another.
    assert card["cable_left_out_pct"] > 3.0
    again, case = kept(tmp_path, factor), case_of(rows[0])
    assert again.factor(case).outside is None
    # Between the two, and of none of them.
    other = again.factor(replace(case, material=Material(young=1.5 * STATED.young)))
    assert "is none of the trained" in str(other.outside)


def test_cables_that_are_configured_alike_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="cables hose and tube are configured alike"):
        load_own_runs(write(tmp_path / "runs.csv", two_cables(STATED.young)))


def test_no_place_is_learned_from_guides_of_different_ways(tmp_path: Path) -> None:
    rows = [
        {**row, "advance_m_per_rad": 2.0e-3 if row["run"] == "r0" else 3.0e-3}
        for row in hidden_runs(5)
    ]
    factor = learned(tmp_path, rows).factor
    assert factor.place is None
    assert "place" not in factor.card


def _spoil(rows: list[dict[str, float | str]], how: str) -> None:
    for row in rows:
        if how == "millimetres":
            row["z_m"], row["s_fem_m"] = 1e3 * float(row["z_m"]), 1e3 * float(row["s_fem_m"])
        elif how == "mixed units" and row["run"] == "r4":
            row["cylinder_diameter_m"] = 1e3 * float(row["cylinder_diameter_m"])
        elif how == "swapped":
            row["theta_rad"], row["z_m"] = row["z_m"], row["theta_rad"]
        elif how == "NaN" and row["run"] == "r4":
            row["theta_rad"] = "nan"
        elif how == "twins" and row["run"] == "r3":
            twin = next(o for o in rows if o["run"] == "r0" and o["marker"] == row["marker"])
            row.update({**twin, "run": "r3"})


@pytest.mark.parametrize(
    ("how", "sentence"), [("millimetres", "are units mixed"), ("swapped", "columns swapped")]
)
def test_bad_tables_are_refused(how: str, sentence: str, tmp_path: Path) -> None:
    rows = hidden_runs(1)
    _spoil(rows, how)
    with pytest.raises(ValueError, match=sentence):
        load_own_runs(write(tmp_path / "runs.csv", rows))


@pytest.mark.parametrize(
    ("how", "run", "sentence"),
    [
        ("mixed units", 4, "are units mixed"),
        ("NaN", 4, "theta_rad must be finite, got nan"),
        ("twins", 3, "run r3 measures exactly what run r0 does"),
    ],
)
def test_a_bad_run_is_left_out(how: str, run: int, sentence: str, tmp_path: Path) -> None:
    rows = hidden_runs(1)
    good = load_own_runs(write(tmp_path / "good.csv", rows)).cells
    _spoil(rows, how)
    found = load_own_runs(write(tmp_path / "runs.csv", rows))
    (refusal,) = found.refused
    assert sentence in refusal
    kept = [cell.s_exp for cell in good if cell.case != run + 1]
    assert [cell.s_exp for cell in found.cells] == kept


@pytest.mark.parametrize(
    ("verdict", "complete", "losses", "markers", "sentence"),
    [
        ("incomplete", False, [], True, "run a is incomplete: why"),
        ("failed", True, [], True, "run a is failed: why"),
        ("not judged", True, [], True, "run a is not judged: why"),
        ("good", True, ["3 frames were lost"], True, "run a is unhealthy: 3 frames were lost"),
        ("good", True, [], False, "run a has no marker"),
    ],
)
def test_unfit_runs_are_refused(
    verdict: str, complete: bool, losses: list[str], markers: bool, sentence: str, tmp_path: Path
) -> None:
    condition = {
        "cylinder_diameter_mm": 30.0, "cable_diameter_mm": 4.0, "tension_n": 3.9,
        "marker_spacing_mm": 100.0, "markers": 4, "young_mpa": 2.6,
    }  # fmt: skip
    rows = [{"id": 1, "s_fem_m": 0.11, "s_tracked_m": 0.107 if markers else None}]
    record = {
        "identity": {"condition": {name: {"value": v} for name, v in condition.items()}},
        "outcome": {
            "verdict": verdict,
            "complete": complete,
            "sentences": ["why"],
            "losses": losses,
        },
        "markers": rows,
    }
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "run.json").write_text(json.dumps(record))
    with pytest.raises(ValueError, match=sentence):
        load_own_runs(tmp_path)
