"""Any cable on any cylinder: elements of the default length are short enough, or it is refused."""

from __future__ import annotations

import dataclasses

import pytest
from random_conditions import TOO_LONG, effort, planned

from cable_fem_node.dynamics.state import SolverError

CONDITIONS = 200
# The promise: elements of half the length change the wound stretch by less [%].
STRETCH_PCT = 0.2


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(CONDITIONS))
def test_default_elements_are_short_enough_or_it_is_refused(seed):
    try:
        run = planned(seed)
        if effort(run)[0] > TOO_LONG:
            pytest.skip("takes minutes")
        result = run.wind(whole=False)
    except (ValueError, SolverError) as error:
        sentence = str(error)
        assert sentence
        assert "\n" not in sentence
        assert any(letter.isdigit() for letter in sentence), "no number that it was refused for"
        return
    half = dataclasses.replace(run.config, segment_length=0.5 * run.config.resolved.segment)
    finer = dataclasses.replace(run, config=half).wind(whole=False)
    off = 100.0 * (result.stretch / finer.stretch - 1.0)
    assert abs(off) < STRETCH_PCT, f"{run.config.case}, {run.config.law}: {off:.3f} %"
