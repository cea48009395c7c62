"""`winding identify`: what it reads, reports and refuses."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rods import CONFIG, wound
from typer.testing import CliRunner, Result

from winding_cli.app import app


@cache
def truth() -> str:
    """Return P1 to P4 of case 4 as 2.5 mm elements lay them with 2.6 MPa, out of order."""
    places = zip(*wound(CONFIG, segment=2.5e-3), strict=True)
    rows = [f"{n},{theta:.4f},{z:.5f}" for n, (theta, z) in enumerate(places, start=1)]
    return "\n".join(["marker,theta_rad,z_m", "P0,0,0", rows[1], rows[0], *rows[2:]])


def identify(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["identify", *map(str, arguments)])


def identified(tmp_path: Path, *arguments: object) -> tuple[dict[str, Any], str]:
    """Return the JSON and the text in one line of a command that succeeds."""
    out = tmp_path / "found.json"
    result = identify(*arguments, "--json", out)
    assert result.exit_code == 0, result.output
    return json.loads(out.read_text()), " ".join(result.output.split())


def assert_refused(result: Result, sentence: str) -> None:
    assert result.exit_code == 2
    assert sentence in " ".join(result.output.split())
    assert "Traceback" not in result.output


@pytest.fixture
def markers(tmp_path: Path) -> Path:
    path = tmp_path / "markers.csv"
    path.write_text(truth())
    return path


@pytest.mark.slow
def test_markers_give_the_modulus_and_the_markers_to_come(markers: Path, tmp_path: Path) -> None:
    found, text = identified(tmp_path, markers, "--case", 4, "--use", 2)
    # The estimator's elements are twice as long; the specification's 3 %.
    assert found["young_pa"] == pytest.approx(2.6e6, rel=0.03)
    assert abs(found["young_pa"] - 2.6e6) < found["half_width_90_pa"]
    assert [row["id"] for row in found["residuals"]] == [1, 2]
    assert [row["id"] for row in found["predicted"]] == [3, 4]
    # One standard error of the rod's angles is 0.05 %.
    assert all(row["error_pct"] < 0.1 for row in found["predicted"])
    assert "nine times in ten within" in text


@pytest.mark.slow
def test_two_runs_give_the_constants_of_a_nonlinear_law(tmp_path: Path) -> None:
    # Cases 1 and 2 with Mooney-Rivlin, 2.6 MPa, C01 / C10 = 0.25, elements of 2.5 mm.
    for name, rows in (
        ("light", "1,8.35030,0.00654\n2,16.65919,0.02153"),
        ("heavy", "1,12.03372,0.01239"),
    ):
        (tmp_path / f"{name}.csv").write_text(f"marker,theta_rad,z_m\n{rows}\n")
    found, text = identified(
        tmp_path, tmp_path / "light.csv", tmp_path / "heavy.csv",
        "--case", 1, "--weight-n", 1.962, "--weight-n", 3.924,
        "--law", "mooney_rivlin", "--duration-s", 12,
    )  # fmt: skip
    total = 2.6e6 / (4.0 * 1.47)
    assert found["young_pa"] == pytest.approx(2.6e6, rel=0.03)
    assert abs(found["c10_pa"] - 0.8 * total) < 3.0 * found["c10_standard_error_pa"]
    assert found["statement"] in text


def test_tensile_test_names_the_law_that_fits_best(tmp_path: Path) -> None:
    strain = np.linspace(0.0, 1.0, 30)
    noise = 0.002 * np.random.default_rng(1).standard_normal(30)
    stress = np.maximum(2.6 * np.log1p(strain) / (1.0 + strain) + noise, 0.0)
    path = tmp_path / "tensile.csv"
    rows = "".join(f"{100.0 * e},{s}\n" for e, s in zip(strain, stress, strict=True))
    path.write_text(f"strain_pct,stress_mpa\n{rows}")
    found, text = identified(tmp_path, "--tensile", path)
    assert "hencky fits best" in text
    assert len(found["laws"]) == 5
    assert found["laws"][0]["young"] == pytest.approx(2.6e6, rel=0.01)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "holds no row of numbers"),
        ("marker,theta_rad,z_m\n", "holds no row of numbers"),
        ("marker,theta_rad\n1,6.5\n", "needs a column z_m; it has marker, theta_rad"),
        ("marker,theta_rad,z_m\n1,six,0.1\n", "row 1 of"),
        ("marker,theta_rad,z_m\n-1,6.5,0.1\n", "marker must be a whole number, got '-1'"),
        ("marker,theta_rad,z_m\n0,0,0\n", "holds no marker beside P0"),
        ("marker,theta_rad,z_m\n1,6.5,0.1\n2,6.4,0.1\n", "wound angles must ascend"),
    ],
)
def test_bad_table_of_markers_is_refused(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "markers.csv"
    path.write_text(text)
    assert_refused(identify(path, "--case", 4), sentence)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ([], "give recordings or tables of markers, or --tensile"),
        (["{markers}"], "say what to wind: --case 1 to 12"),
        (["{markers}", "--tensile", "{markers}"], "give recordings or tables"),
        (["{markers}", "--case", 4, "--element", "solid"], "winds the rod, not the element solid"),
        (
            ["{markers}", "--case", 4, "--weight-n", 1, "--weight-n", 2],
            "once for each of 1 sources",
        ),
        (["{markers}", "--case", 4, "--weight-n", -1], "--tension-n must be positive"),
        (["--tensile", "{markers}"], "needs one column of strain, strain_pct"),
        (["nowhere.csv", "--case", 4], "nowhere.csv does not exist"),
        (["{folder}"], "does not say what was wound"),
        (["{folder}", "--case", 4], "metadata.yaml"),
    ],
)
def test_bad_question_is_refused(
    markers: Path, tmp_path: Path, arguments: list[object], sentence: str
) -> None:
    folder = tmp_path / "empty"
    folder.mkdir()
    known = {"{markers}": markers, "{folder}": folder}
    assert_refused(identify(*(known.get(str(item), item) for item in arguments)), sentence)


def test_markers_of_no_cable_are_not_explained_away(tmp_path: Path) -> None:
    path = tmp_path / "markers.csv"
    path.write_text("marker,theta_rad,z_m\n1,6.5751,0.00454\n2,15.9,0.01531\n")
    result = identify(path, "--case", 4)
    assert result.exit_code == 1
    assert "misses a marker by" in " ".join(result.output.split())


@pytest.mark.processes
def test_recorded_run_is_read_with_its_own_condition(recorded_run: Any, tmp_path: Path) -> None:
    found, _ = identified(tmp_path, recorded_run.bag)
    # Case 4 lies where the paper measured it: P1 at 6.28 rad instead of 6.58 with 2.6 MPa.
    assert [row["id"] for row in found["residuals"]] == [1]
    assert found["residuals"][0]["theta"] == pytest.approx(6.28, abs=0.01)
    assert 4.0e6 < found["young_pa"] < 5.2e6


def test_rig_comes_with_covariance_and_what_is_unobservable(markers: Path, tmp_path: Path) -> None:
    found, text = identified(tmp_path, markers, "--case", 4, "--use", 2, "--rig")
    assert found["refused"] == ""
    assert np.shape(found["covariance"]) == (len(found["names"]),) * 2
    rig = found["rig"]
    # The rod wound 198 mm and 2.6 MPa under the whole weight.
    assert rig["free_length"]["low"] < 0.198 < rig["free_length"]["high"]
    assert rig["effective_young"]["low"] < 2.6e6 < rig["effective_young"]["high"]
    assert "load_share" in found["unobservable"]
    assert [row["id"] for row in found["predicted"]] == [3, 4]
    for row in found["predicted"]:
        assert abs(row["s_measured_m"] - row["s_m"]) < row["half_width_90_m"]
    assert "unobservable, so that the prior remains: " in text


def test_known_tension_is_known(markers: Path, tmp_path: Path) -> None:
    found, _ = identified(tmp_path, markers, "--case", 4, "--rig", "--known-tension")
    assert found["rig"]["load_share"]["deviation"] == 0.0
    assert found["rig"]["young"]["low"] < 2.6e6 < found["rig"]["young"]["high"]
    assert found["unobservable"] == []


def test_the_prior_of_the_rig_is_what_is_typed(markers: Path, tmp_path: Path) -> None:
    words = ("--prior-load-share", "1,1", "--prior-guide-drag-n", "0,0", "--prior-steady", 1)
    found, _ = identified(tmp_path, markers, "--case", 4, "--use", 2, "--rig", *words)
    assert found["rig"]["load_share"]["deviation"] == 0.0
    assert "load_share" not in found["unobservable"]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--scatter-mm", 1), "need --rig"),
        (("--prior-load-share", "0.5,0.9"), "--prior-load-share needs --rig"),
        (("--rig", "--prior-load-share", "0.9,0.5"), "load_share must ascend, got [0.9, 0.5]"),
        (("--rig", "--prior-build-up-mm", 3), "--prior-build-up-mm must be a list of 2 numbers"),
        (("--rig", "--fixing-mm", -2), "fixing must not be negative, got -0.002"),
        (("--rig", "--scatter-mm", "nan"), "scatter must be finite"),
    ],
)
def test_bad_rig_options_are_refused(
    markers: Path, arguments: tuple[object, ...], sentence: str
) -> None:
    assert_refused(identify(markers, "--case", 4, *arguments), sentence)
