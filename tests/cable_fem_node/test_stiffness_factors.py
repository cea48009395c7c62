"""Separate factors on the axial and the bending stiffness of the cable."""

from __future__ import annotations

from dataclasses import replace

import pytest
from rods import tracked

from cable_fem_node.identification.quasi_static import lay
from cable_fem_node.winding.prediction import predict
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cases import Material, paper_case


def config(**material: float) -> WindingConfig:
    return WindingConfig(case=replace(paper_case(4), material=Material(**material)))


def test_half_the_axial_stiffness_doubles_the_strain_of_the_span() -> None:
    plain, soft = config().resolved, config(axial_factor=0.5).resolved
    assert soft.stretch - 1.0 == pytest.approx(2.0 * (plain.stretch - 1.0), rel=1e-12)


def test_bending_factor_scales_what_bending_costs_of_the_tension() -> None:
    plain, stiff = config().resolved, config(bending_factor=3.0).resolved
    lost = [model.tension - model.wound_tension(model.tension) for model in (plain, stiff)]
    assert lost[1] == pytest.approx(3.0 * lost[0], rel=1e-9)


def test_both_factors_together_are_another_modulus() -> None:
    factors = predict(config(axial_factor=2.0, bending_factor=2.0), duration=4.0, rate=5.0)
    modulus = predict(config(young=5.2e6), duration=4.0, rate=5.0)
    # The same numbers but for rounding, which some thousand steps of contact amplify.
    assert factors.theta[-1] == pytest.approx(modulus.theta[-1], rel=1e-6)
    assert factors.stretch == pytest.approx(modulus.stretch, rel=1e-6)
    assert factors.stretch_closed_form == pytest.approx(modulus.stretch_closed_form, rel=1e-12)


def test_rod_with_another_bending_stiffness_follows_its_closed_form() -> None:
    run = predict(config(axial_factor=1.5, bending_factor=0.5), duration=6.0, rate=5.0)
    # The bar of the specification for lengths: 0.2 %.
    assert run.stretch == pytest.approx(run.stretch_closed_form, rel=2.0e-3)
    assert run.energy.balance_pct < 1.0


def test_identification_s_closed_form_honours_the_factors() -> None:
    def theta(wound: WindingConfig, young: float) -> float:
        law = replace(wound.resolved.law, young=young)
        return float(lay(tracked(wound), law)[0][0])

    factors = theta(config(axial_factor=2.0, bending_factor=2.0), 2.6e6)
    assert factors == pytest.approx(theta(config(), 5.2e6), rel=1e-12)


@pytest.mark.parametrize("name", ["axial_factor", "bending_factor"])
def test_solid_refuses_a_factor(name: str) -> None:
    with pytest.raises(ValueError, match=f"{name} must be 1, got 0.5"):
        predict(config(**{name: 0.5}), duration=0.1, element="solid")


@pytest.mark.parametrize("name", ["axial_factor", "bending_factor"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("inf"), float("nan")])
def test_factors_must_be_positive_and_finite(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name} must be positive and finite"):
        Material(**{name: value})
