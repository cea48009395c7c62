"""Prony series: what is written, what is refused, and creep in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from winding_core.cable.condition import Condition
from winding_core.cable.prony import PronySeries
from winding_core.parameters import ParameterError


def test_terms_are_read_in_order() -> None:
    series = PronySeries.parse("0.2:1.5 + 0.1:1e+3")
    assert series == PronySeries(shares=(0.2, 0.1), times=(1.5, 1000.0))
    assert series.left == pytest.approx(0.7)
    assert PronySeries.parse("") == PronySeries.parse(" ") == PronySeries()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0.2", "needs terms share:seconds"),
        ("0.2:x", "needs terms share:seconds"),
        ("0.2:1+", "needs terms share:seconds"),
        ("0.2:1:2", "needs terms share:seconds"),
        ("-0.1:3", "shares above 0, got -0.1"),
        ("nan:3", "shares above 0, got nan"),
        ("0.1:0", "times of 0.001 to 3e.09 s, got 0 s"),
        ("0.1:inf", "got inf s"),
        ("0.6:1+0.4:2", "add up to at most 0.95, got 1"),
        ("+".join(["0.01:1"] * 9), "at most 8 terms, got 9"),
    ],
)
def test_what_is_no_series_is_refused_in_one_sentence(text: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        PronySeries.parse(text)


def test_creep_of_one_term_is_that_of_the_standard_linear_solid() -> None:
    t = np.linspace(0.0, 20.0, 50)
    exact = 1.0 + 0.3 / 0.7 * (1.0 - np.exp(-0.7 * t / 2.0))
    np.testing.assert_allclose(PronySeries.parse("0.3:2").creep(t), exact, rtol=1.0e-12)


def test_creep_of_several_terms_solves_their_equations() -> None:
    series = PronySeries.parse("0.2:0.5+0.1:30+0.15:3")
    g, tau = np.array(series.shares), np.array(series.times)
    q, step = np.zeros(3), 1.0e-3
    for _ in range(5000):
        rate = (g * (1.0 + q.sum()) - q) / tau
        middle = q + 0.5 * step * rate
        q += step * (g * (1.0 + middle.sum()) - middle) / tau
    # The midpoint rule's error of second order.
    assert series.creep(5.0) == pytest.approx(1.0 + q.sum(), rel=1.0e-6)
    assert series.creep(1.0e6) == pytest.approx(1.0 / series.left, rel=1.0e-9)


def test_a_condition_takes_it_and_is_no_longer_the_paper_s() -> None:
    case = Condition(case=4, prony="0.2:1.5").resolved().case
    assert case.material.prony.times == (1.5,)
    assert not case.is_published
    with pytest.raises(ParameterError, match=r"^--prony needs terms"):
        Condition.from_typed({"case": 4, "prony": "soft"}, spelling=lambda key: f"--{key}")
