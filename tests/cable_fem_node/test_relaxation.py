"""A cable whose stress fades: against the standard linear solid, at rest and integrated."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from axis_readings import axis_reading
from rods import CASE, DRIVE, follow, tracked

from cable_fem_node.identification import IdentificationError
from cable_fem_node.rod.relaxation import decays, fade
from cable_fem_node.rod.rod_records import relaxation
from cable_fem_node.winding.prediction import predict
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.cases import Material
from winding_core.cable.material_law import MaterialLaw
from winding_core.cable.prony import PronySeries
from winding_core.machine.readings import AxisReading

EA = CASE.material.young * CASE.section_area
# One term: the share that fades, and its time at a held stretch [s].
G, TAU = 0.3, 5.0
SOLID = f"{G}:{TAU}"
BAR = 0.01  # The bar of the specification for relaxation and creep


def config(prony: str = SOLID, **more: Any) -> WindingConfig:
    material = Material(prony=PronySeries.parse(prony))
    return WindingConfig(case=replace(CASE, material=material), **more)


def crept(t: Any) -> Any:
    """Strain of a standard linear solid under a dead load, over that at once."""
    return 1.0 + G / (1.0 - G) * (1.0 - np.exp(-(1.0 - G) * np.asarray(t) / TAU))


def standing(angle: float = 0.0, guide: float = 0.0) -> AxisReading:
    return axis_reading(angle, guide)


def wound(until: float, prony: str = SOLID, **more: Any) -> RodWinding:
    return follow(RodWinding(config(prony, **more)), until)


def held(
    model: RodWinding, until: float, tension: float | None = None, stopped: float = 10.0
) -> RodWinding:
    """Go on with a machine that stands where it was at a time [s]."""
    reading = standing(*DRIVE.positions(stopped))
    while model.time < until - 1.0e-9:
        model.advance_to(model.time + 0.05, reading, tension)
    return model


@pytest.fixture(scope="module")
def relaxed() -> RodWinding:
    """Wound for 10 s and held for 5 s."""
    return held(wound(10.0), 15.0)


@pytest.mark.slow
@pytest.mark.parametrize("period", [0.02, 2.0])
def test_span_creeps_under_the_dead_weight_as_a_standard_linear_solid(period: float) -> None:
    model = RodWinding(config())
    cable = model.cable()["s"][-1]
    for t in np.arange(period, 10.0 + 1.0e-9, period):
        model.advance_to(float(t), standing())
    strain = CASE.weight / EA * float(crept(10.0))
    # Measured 1e-5, whatever the period; the bar is 1 %.
    np.testing.assert_allclose(model.stretch() - 1.0, strain, rtol=1.0e-3)
    np.testing.assert_allclose(model.tension(), CASE.weight, rtol=1.0e-3)
    # The span keeps its length, so the cable that it gains by creeping goes back to the weight.
    span = model.config.free_length
    assert model.cable()["s"][-1] == pytest.approx(span / (1.0 + strain), rel=1.0e-4)
    assert model.cable()["s"][-1] < cable
    assert model.energy.balance_pct < 0.1


@pytest.mark.slow
def test_cable_that_is_held_wound_relaxes_as_a_standard_linear_solid(relaxed: RodWinding) -> None:
    resolved = relaxed.config.resolved
    _, theta, _ = relaxed.wound_path()
    # Behind the last turns, whose cable slips from the span's tension into that of the wound.
    middle = 0.5 * (theta[1:] + theta[:-1])
    kept = (middle > 0.5) & (middle < theta[-1] - 5.0)
    # A stiff cable comes to lie this angle behind the tangent point, see docs/solver.md.
    late = np.arccos(1.0 - resolved.bending_share)
    landed = np.array([DRIVE.time_at_angle(angle + late) for angle in middle[kept].tolist()])
    at_once = CASE.weight * crept(landed)
    faded = at_once - CASE.weight
    at_once -= CASE.weight - resolved.wound_tension(CASE.weight)
    left = np.exp(-(relaxed.time - landed) / TAU)
    expected = at_once - (G * at_once + (faded - G * at_once) * left)
    tension = relaxed.tension()[: middle.size][kept]
    assert kept.sum() > 20
    np.testing.assert_allclose(tension, expected, rtol=BAR)
    # It has relaxed by far more than the bar.
    assert tension.max() < 0.95 * CASE.weight
    assert relaxed.energy.balance_pct < 0.1


def test_relaxing_moves_nothing() -> None:
    model = wound(8.0)
    _, theta, z = (values.copy() for values in model.wound_path())
    held(model, 12.0, stopped=8.0)
    _, later, z_later = model.wound_path()
    laid = theta < theta[-1] - 6.0
    # A penalty spring that lost its load would push the cable out by 10 um, 3e-3 of the strain.
    assert np.abs(later[: laid.size] - theta)[laid].max() * CASE.centreline_radius < 1.0e-6
    assert np.abs(z_later[: laid.size] - z)[laid].max() < 1.0e-6


@pytest.mark.slow
def test_cable_at_rest_relaxes_as_if_it_were_integrated(relaxed: RodWinding) -> None:
    integrated = held(wound(10.0, rests=False), 15.0)
    assert relaxed.live_nodes < integrated.live_nodes
    # What docs/solver.md promises of resting turns: 0.1 % of the span tension.
    np.testing.assert_allclose(relaxed.tension(), integrated.tension(), atol=1e-3 * CASE.weight)
    assert relaxed.energy.relaxation == pytest.approx(integrated.energy.relaxation, rel=1.0e-3)


@pytest.mark.slow
def test_cable_that_is_woken_has_relaxed_meanwhile() -> None:
    models = [held(wound(10.0, rests=rests), 12.0) for rests in (True, False)]
    resting = models[0].nodes - models[0].live_nodes
    # Slip under a small tension goes through turns at rest.
    woken, integrated = (held(model, 13.0, 0.2 * CASE.weight) for model in models)
    assert woken.nodes - woken.live_nodes < resting
    np.testing.assert_allclose(woken.tension(), integrated.tension(), atol=2e-3 * CASE.weight)
    assert woken.energy.balance_pct < 0.1
    assert integrated.energy.balance_pct < 0.1


@pytest.mark.slow
def test_asking_often_changes_nothing() -> None:
    asked, left = wound(8.0), wound(8.0)
    for t in np.arange(8.02, 10.0, 0.02).tolist():
        for model in (asked, left):
            follow(model, t)
        _ = asked.energy, asked.tension(), asked.cable()
    np.testing.assert_allclose(asked.tension(), left.tension(), rtol=1.0e-9)


@pytest.mark.parametrize("law", ["neo_hookean", "hencky_cauchy"])
def test_energy_closes_for_laws_and_several_terms(law: str) -> None:
    energy = wound(8.0, "0.1:0.2+0.15:2+0.1:300", law=law).energy
    # The bar of the specification; measured 0.01 %.
    assert energy.balance_pct < 0.1
    assert energy.relaxation > 10.0 * energy.damping > 0.0


def test_prediction_s_closed_form_creeps() -> None:
    run = predict(config(), duration=10.0, rate=5.0)
    elastic = run.config.resolved.wound_stretch(CASE.weight, tuple)
    # The bar of the specification for lengths: 0.2 %.
    assert run.stretch == pytest.approx(run.stretch_closed_form, rel=2.0e-3)
    assert run.stretch_closed_form > elastic + 0.01


def test_recursion_is_exact_for_a_linear_rise_over_a_long_step() -> None:
    law = MaterialLaw()
    relax = relaxation(law, 1.0, PronySeries.parse("0.3:2+0.2:0.5"))
    decay, ramp, rows = np.zeros(2), np.zeros(2), np.zeros((3, 1))
    step, rate = 7.0, 1000.0
    decays(step, relax, decay, ramp)
    viscous, change, _ = fade(rate * step, rate * step / law.young, rows, 0, decay, ramp, relax)
    # tau dq/dt + q = g rate t from nothing.
    exact = sum(
        g * rate * (step - tau * (1.0 - np.exp(-step / tau))) for g, tau in ((0.3, 2.0), (0.2, 0.5))
    )
    assert viscous == pytest.approx(exact, rel=1.0e-12)
    assert change == viscous


HEAVY = replace(CASE, weight=8.0, material=Material(prony=PronySeries.parse("0.5:3")))


@pytest.mark.parametrize(
    ("ask", "sentence"),
    [
        (lambda: WindingConfig(case=HEAVY, law="hencky"),
         "8 N end as 16 N would at once: law hencky carries"),
        (lambda: predict(config(), duration=0.1, element="solid"),
         "the solid element knows elastic cables alone"),
    ],
)  # fmt: skip
def test_what_cannot_creep_is_refused(ask: Callable[[], Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        ask()


def test_identification_refuses_a_series() -> None:
    with pytest.raises(IdentificationError, match="leave out prony"):
        tracked(config())
