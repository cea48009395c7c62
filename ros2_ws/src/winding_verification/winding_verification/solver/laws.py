"""Material laws: uniaxial, shear, volume change, general deformation, limit loads."""

import math

import numpy as np
from scipy.optimize import brentq

from cable_fem_node.solid.solid_law import SolidLaw
from winding_core.cable.material_law import MaterialLaw
from winding_core.units import MEGAPASCAL
from winding_verification.solver.suite import Values, given, rotation_about

HYPERELASTIC = ("neo_hookean", "mooney_rivlin")


def uniaxial() -> Values:
    """M01: stretch and lateral stretch under dead nominal stress, every law."""
    values: Values = {}
    for law in ("hencky_cauchy", "hencky", "mooney_rivlin", "neo_hookean"):
        rule = MaterialLaw(law=law)
        for stress in (0.1561, 0.3122, 0.6245):
            stretch = rule.stretch_at(stress * MEGAPASCAL)
            values[f"stretch_{law}_{stress:g}"] = stretch
            values[f"lateral_{law}_{stress:g}"] = float(rule.lateral_stretch(stretch))
    return values


def incompressible() -> Values:
    """M02: incompressible stretch with G from nu = 0.47 and from nu = 0.5."""
    values: Values = {}
    for stress in (0.06939, 0.1388, 0.1561, 0.3122, 0.6245, 1.249):
        for law in HYPERELASTIC:
            rule = MaterialLaw(law=law, incompressible=True)
            values[f"{law}_{stress:g}"] = rule.stretch_at(stress * MEGAPASCAL)
        third = MaterialLaw(law="neo_hookean", poisson=0.5, incompressible=True)
        values[f"neo_hookean_third_{stress:g}"] = third.stretch_at(stress * MEGAPASCAL)
    return values


def limit_load() -> Values:
    """M03: the greatest dead stress of Hooke's law on logarithmic strain."""
    values: Values = {}
    for law in ("hencky", "hencky_cauchy"):
        rule = MaterialLaw(law=law)
        stress, stretch = rule.limit()
        values[f"stress_{law}"], values[f"stretch_{law}"] = stress, stretch
        values[f"stress_at_2_{law}"] = float(rule.nominal_stress(2.0))
    return values


def follower_pressure() -> Values:
    """M04: stretch under Cauchy stress on the present area: exp(sigma / E)."""
    rule = MaterialLaw(law="hencky_cauchy")
    values: Values = {}
    for stress in (0.06939, 0.1388, 0.1561, 0.3122, 0.6245, 1.249):

        def excess(stretch: float, stress: float = stress) -> float:
            true = rule.nominal_stress(stretch) / rule.lateral_stretch(stretch) ** 2
            return float(true) - stress * MEGAPASCAL

        values[f"stretch_{stress:g}"] = brentq(excess, 1.0, 3.0)
    return values


def general() -> Values:
    """M05: Cauchy stress of general deformation gradients."""
    return {
        f"sigma_{law}_{n}": SolidLaw(law=law).cauchy(gradient).tolist()
        for n, gradient in enumerate(given("M05", "gradients"))
        for law in ("neo_hookean", "mooney_rivlin", "hencky", "hencky_cauchy")
    }


def simple_shear() -> Values:
    """M07: shear stress and normal stress difference of simple shear."""
    values: Values = {}
    for amount in (0.1, 0.3, 0.6, 1.0):
        gradient = np.eye(3)
        gradient[0, 1] = amount
        for law in (*HYPERELASTIC, "hencky"):
            stress = SolidLaw(law=law).cauchy(gradient)
            values[f"shear_{law}_{amount:g}"] = float(stress[0, 1])
            values[f"difference_{law}_{amount:g}"] = float(stress[0, 0] - stress[1, 1])
    return values


def hydrostatic() -> Values:
    """M09: pressure of pure volume change."""
    values: Values = {}
    for volume in (0.98, 0.99, 1.01, 1.02):
        gradient = volume ** (1.0 / 3.0) * np.eye(3)
        for law in ("neo_hookean", "hencky", "hencky_cauchy"):
            stress = SolidLaw(law=law).cauchy(gradient)
            values[f"pressure_{law}_{volume:g}"] = -float(np.trace(stress)) / 3.0
    return values


def biot() -> Values:
    """M10: the linear law is linear in nominal strain, whatever the rotation."""
    law = SolidLaw()
    rotation = rotation_about([0.0, 0.0, 1.0], math.radians(40.0))
    lateral = 1.0 - law.poisson * 0.12
    stress = law.first_piola(rotation @ np.diag([1.12, lateral, lateral]))
    back = rotation.T @ stress
    return {"axial": float(back[0, 0]), "lateral": float(abs(back[1, 1]) + abs(back[2, 2]))}
