"""Material laws: consistency of stress, energy, tables and the uniaxial response."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm, polar

from cable_fem_node.rod.rod_kernels import law_energy, law_value
from cable_fem_node.rod.rod_records import axial_response
from cable_fem_node.solid.solid_law import SolidLaw
from winding_core.cable.material_law import LAWS, MaterialLaw, NoEquilibriumError

# A parameter of the law's own, far from its default.
STIFFENING = {"law": "mooney_rivlin", "mooney_ratio": 5.0}


def test_linear_law_agrees_with_the_polar_decomposition():
    rule, rng = SolidLaw(law="linear"), np.random.default_rng(3)
    for _ in range(6):
        gradient = expm(0.25 * rng.standard_normal((3, 3)))
        rotation, stretch = polar(gradient)
        strain = stretch - np.eye(3)
        stress = 2.0 * rule.shear_modulus * strain + rule.lame * np.trace(strain) * np.eye(3)
        assert rule.first_piola(gradient) == pytest.approx(rotation @ stress, rel=1e-10, abs=1e-3)


@pytest.mark.parametrize("own", [*({"law": law} for law in LAWS), STIFFENING])
def test_uniaxial_response_has_free_sides(own):
    rule = SolidLaw.of(MaterialLaw(**own))
    for stretch in (0.8, 1.1, 1.5):
        lateral = float(rule.lateral_stretch(stretch))
        stress = rule.first_piola(np.diag([stretch, lateral, lateral]))
        # Zero against Young's modulus, to the accuracy of the lateral root.
        assert abs(stress[1, 1]) < 1e-8 * rule.young
        assert stress[0, 0] == pytest.approx(float(rule.nominal_stress(stretch)), rel=1e-8)


@pytest.mark.parametrize("law", LAWS)
def test_table_is_the_law(law):
    rule = MaterialLaw(law=law)
    response = axial_response(rule, 1.0)
    for stretch in np.random.default_rng(4).uniform(0.4, 3.0, 50):
        stress = law_value(stretch, response)
        energy = law_energy(stretch, response)
        # Cubic interpolation over steps of 0.002.
        assert stress == pytest.approx(float(rule.nominal_stress(stretch)), abs=1e-6 * rule.young)
        assert energy == pytest.approx(float(rule.energy_density(stretch)), abs=1e-6 * rule.young)


def test_dead_load_beyond_the_limit_is_refused():
    with pytest.raises(NoEquilibriumError, match=r"at most 0\.9565 MPa"):
        MaterialLaw(law="hencky").stretch_at(1.249e6)


def test_inverted_gradient_is_refused():
    with pytest.raises(ValueError, match="determinant"):
        SolidLaw().first_piola(np.diag([1.0, 1.0, -1.0]))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"law": "wood"}, "law must be one of"),
        ({"young": -1.0}, "young must be positive"),
        ({"poisson": 0.6}, "poisson must lie"),
        ({"law": "linear", "incompressible": True}, "incompressible applies"),
    ],
)
def test_invalid_laws_are_refused(change, words):
    with pytest.raises(ValueError, match=words):
        MaterialLaw(**change)
