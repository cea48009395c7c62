from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from correction_node.models.dataset import load_data_set
from correction_node.models.factor_models import RIG_LAW, LayOns, case_of, fit_rig, reference_law
from winding_core.cable.cases import paper_case
from winding_core.machine.tension import DeadWeight, RigTension

CELLS = load_data_set("rod").cells
HIDDEN = RigTension(
    offset=2.0, weight_share=0.3, diameter_gain=1.2, start_share=0.35, build_up_length=0.3
)


def test_a_case_is_known_by_its_markers() -> None:
    for number in (2, 9):
        case = paper_case(number)
        found = case_of([cell for cell in CELLS if cell.case == number])
        assert found.weight == pytest.approx(case.weight, rel=1e-12)
        assert found.marker_spacing == pytest.approx(case.marker_spacing, rel=1e-12)
        assert (found.cylinder_diameter, found.cable_diameter) == (
            case.cylinder_diameter,
            case.cable_diameter,
        )


def test_a_hidden_tension_law_is_found_again() -> None:
    lay_ons = LayOns(CELLS, RIG_LAW)
    laid = lay_ons.lengths(CELLS, HIDDEN)
    cells = [dataclasses.replace(c, s_exp=s) for c, s in zip(CELLS, laid, strict=True)]
    found = fit_rig(cells, lay_ons)
    # No noise: what is left is the fit's own stopping tolerance.
    np.testing.assert_allclose(dataclasses.astuple(found), dataclasses.astuple(HIDDEN), rtol=1e-3)


def test_the_solver_behind_the_lengths_is_recognised() -> None:
    law, distance = reference_law(CELLS)
    assert law == "linear"
    assert distance < 1.5e-3
    other = LayOns(CELLS, "neo_hookean").lengths(CELLS, DeadWeight())
    cells = [dataclasses.replace(c, s_fem=s) for c, s in zip(CELLS, other, strict=True)]
    assert reference_law(cells) == ("neo_hookean", 0.0)


def test_the_papers_simulation_is_no_quasi_static_cable() -> None:
    _, distance = reference_law(load_data_set("paper").cells)
    assert distance > 0.1
