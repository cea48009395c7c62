"""Other people's experiments: files that are made here, in the format of cosseratbench."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import cosserat_files as files
import numpy as np
import pytest
from scipy.special import jn_zeros
from typer.testing import CliRunner

from winding_cli.app import app
from winding_verification.experiments import cosserat_experiments as experiments
from winding_verification.experiments.comparison import compare, found_experiments
from winding_verification.experiments.external_row import ExternalRow
from winding_verification.experiments.scenario import ExternalFileError, read_scenario


def rows(file: Path) -> dict[str, ExternalRow]:
    return {row.quantity: row for row in compare(file)}


def test_cantilever_bends_as_a_beam(tmp_path: Path) -> None:
    (row,) = compare(files.cantilever(tmp_path))
    # A deflection of 2 % is 0.02 % off Euler and Bernoulli's, which is linear.
    assert row.computed < 5.0e-4
    assert row.passed


@pytest.mark.parametrize("span", [0.7, 0.9])
def test_cable_hangs_in_the_elastic_catenary(tmp_path: Path, span: float) -> None:
    found = rows(files.catenary(tmp_path, span))
    # Bending, which the reference leaves out, rounds the supports of the shorter span.
    assert found["shape_error"].computed < 2.0e-3
    assert found["sag_error"].computed < 4.0e-3
    assert all(row.passed for row in found.values())


def test_elastic_catenary_stretches_more_than_an_inextensible_one(tmp_path: Path) -> None:
    spec = read_scenario(files.catenary(tmp_path)).rods[0]
    stiff = replace(spec, section=replace(spec.section, young=1.0e15))
    _, z = experiments.elastic_catenary(stiff, 9.81, 0.8)
    # Of length 1 over a span of 0.8: sinh(u) / u = 1.25, sag tanh(u / 2) / 2.
    u = 1.1828
    assert math.sinh(u) / u == pytest.approx(1.25, rel=1.0e-4)
    assert -z.min() == pytest.approx(0.5 * math.tanh(0.5 * u), rel=1.0e-4)
    assert experiments.elastic_catenary(spec, 9.81, 0.8)[1].min() < z.min()


def test_hanging_rod_swings_as_theory_has_it(tmp_path: Path) -> None:
    found = rows(files.pendulum(tmp_path))
    # The swing of 2 cm is 2e-5 slower than a small one, a hundred elements 1e-4 off.
    assert found["period_error"].computed < 3.0e-4
    # What is left of other swings in the file's first shape.
    assert abs(found["amplitude_change"].computed) < 1.0e-3


def test_limp_rod_s_period_is_bernoulli_s(tmp_path: Path) -> None:
    spec = read_scenario(files.pendulum(tmp_path)).rods[0]
    # No stretch and little bending: 4 pi / j_0,1 sqrt(L / g).
    section = replace(spec.section, young=1.0e15, bending_factor=1.0e-13)
    expected = 4.0 * math.pi / jn_zeros(0, 1)[0] * math.sqrt(1.0 / 9.81)
    period = experiments.hanging_period(replace(spec, section=section), 9.81)
    assert period == pytest.approx(expected, rel=1.0e-4)


@pytest.mark.parametrize(
    ("overhang", "friction", "holds"),
    [(0.7, 0.3, True), (0.97, 0.2, True), (1.08, 0.4, False), (1.3, 0.15, False)],
)
def test_rope_holds_or_slides_as_the_heavy_capstan_equation_says(
    tmp_path: Path, overhang: float, friction: float, holds: bool
) -> None:
    (row,) = compare(files.capstan(tmp_path, overhang, friction))
    assert row.at_least is not holds
    assert row.passed
    # The rope settles by a twentieth of a millimetre and creeps no further.
    assert row.computed < 1.0e-4 if holds else row.computed > 0.1


def test_critical_moment_of_an_untensioned_clamped_rod_is_greenhill_s(tmp_path: Path) -> None:
    spec = read_scenario(files.twist(tmp_path, 1.0e-6, 1.0, [1.0])).rods[0]
    moment = experiments.critical_twist(spec) * spec.section.torsion / spec.section.bending
    # Timoshenko and Gere: M L / B = 2.861 pi.
    assert moment == pytest.approx(2.861 * math.pi, rel=2.0e-4)


def test_critical_moment_of_a_long_rod_is_that_of_an_endless_one(tmp_path: Path) -> None:
    spec = read_scenario(files.twist(tmp_path, 4.0e4, 1.0, [1.0])).rods[0]
    moment = experiments.critical_twist(spec) * spec.section.torsion / spec.section.bending
    # M^2 = 4 B T, from above by the square of a few half waves over the length.
    assert 1.0 < moment / (2.0 * math.sqrt(4.0e4)) < 1.001


@pytest.mark.campaign
@pytest.mark.parametrize("tension", [1.0, 10.0, 30.0])
def test_rods_lose_their_stability_at_greenhill_s_twist(tmp_path: Path, tension: float) -> None:
    spec = read_scenario(files.twist(tmp_path / "one", tension, 1.0, [1.0])).rods[0]
    critical = experiments.critical_twist(spec)
    levels = [0.96, 0.98, 1.0, 1.02, 1.04, 1.06]
    (row,) = compare(files.twist(tmp_path / "all", tension, critical, levels))
    # The bar; measured are 0.26, 0.30 and 0.35 %.
    assert row.computed <= 5.0e-3
    assert row.passed


def test_rod_that_is_turned_takes_the_moment_of_its_twist(tmp_path: Path) -> None:
    spec = read_scenario(files.twist(tmp_path, 10.0, 1.0, [1.0])).rods[0]
    rod, _ = experiments._built(spec, 20, framed=True)
    rod.spin_angles[:] = 0.5 * (np.arange(20) + 0.5) / 20.0
    rod.turn("end", 0.5)
    # Evenly twisted: half G J theta^2 / L.
    twisting = 0.5 * spec.section.torsion * 0.25
    still = experiments._built(spec, 20, framed=True)[0].internal_energy()
    assert rod.internal_energy() - still == pytest.approx(twisting, rel=1.0e-3)


def test_each_physical_problem_is_computed_once(tmp_path: Path) -> None:
    kept = files.cantilever(tmp_path / "default")
    again = files.cantilever(tmp_path / "a-resolution")
    content = json.loads(again.read_text())
    again.write_text(json.dumps({**content, "varied": {"resolution": 10}}))
    other = files.cantilever(tmp_path / "pile")
    other.write_text(json.dumps({**content, "name": "pile"}))
    assert found_experiments(tmp_path) == ([kept], ("pile",))


def test_published_figures_stand_beside_ours(tmp_path: Path) -> None:
    file = files.cantilever(tmp_path)
    (file.parent / "slow").mkdir()
    result = {"solver": "slow", "metrics": {"tip_deflection_error": 0.0731, "other": None}}
    (file.parent / "slow" / "result.json").write_text(json.dumps(result))
    table = tmp_path / "rows.json"
    done = CliRunner().invoke(app, ["verify", "--external", str(tmp_path), "--json", str(table)])
    assert done.exit_code == 0, done.output
    (row,) = json.loads(table.read_text())
    assert row["published"] == {"slow": 0.0731}
    assert row["pass"]
    assert row["computed"] < 1.0e-3
    assert "1 of 1 quantities within their bar" in done.output


def test_bar_that_is_not_kept_ends_with_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files.cantilever(tmp_path)
    module = "winding_verification.experiments.comparison"
    monkeypatch.setattr(f"{module}._BARS", {"tip_deflection_error": 1.0e-9})
    done = CliRunner().invoke(app, ["verify", "--external", str(tmp_path)])
    assert done.exit_code == 1
    assert "0 of 1 quantities within their bar" in done.output


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"rods": []}, "it has no rods"),
        ({"duration": -1.0}, "duration must be positive and finite, got -1.0"),
        ({"gravity": [0.0, "x", 0.0]}, "could not convert string to float"),
        ({"rods": [{"centerline": [[0.0, 0.0]]}]}, "a centerline must be finite with shape"),
    ],
)
def test_file_that_says_something_else_is_refused_in_one_sentence(
    tmp_path: Path, change: dict[str, object], sentence: str
) -> None:
    file = files.cantilever(tmp_path)
    content = json.loads(file.read_text())
    content["scenario"] |= change
    file.write_text(json.dumps(content))
    with pytest.raises(ExternalFileError, match="is no experiment of cosseratbench") as caught:
        read_scenario(file)
    assert sentence in str(caught.value)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["verify", "--external", "nowhere"], "there is no folder nowhere"),
        (["verify", "--external", "."], "holds no experiment.json of cantilever, capstan"),
        (["verify", "knot", "--external", "."], "no experiment named knot; there are cantilever"),
    ],
)
def test_folder_without_experiments_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], sentence: str
) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 2
    assert sentence in " ".join(done.output.split())
