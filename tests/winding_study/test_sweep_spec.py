"""What a sweep's YAML means, and what of it is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from winding_study.sweep.spec import SpecError, SweepSpec, parse_spec

KINDS = {
    "case": int,
    "friction": float,
    "tension_n": float,
    "young_mpa": float,
    "law": str,
    "rolling": bool,
}


def parsed(text: str) -> SweepSpec:
    return parse_spec(text, KINDS)


def test_a_grid_has_every_combination_the_last_fastest() -> None:
    spec = parsed("parameters: {case: 4, friction: [0.1, 0.2], law: [linear, hencky]}")
    assert [(row["friction"], row["law"]) for row in spec] == [
        (0.1, "linear"),
        (0.1, "hencky"),
        (0.2, "linear"),
        (0.2, "hencky"),
    ]
    assert all(row["case"] == 4 for row in spec)
    assert (len(spec), spec.varied) == (4, ("friction", "law"))


def test_zip_takes_values_side_by_side_and_repeats_single_ones() -> None:
    spec = parsed("{combine: zip, parameters: {case: 4, friction: [0.1, 0.2], tension_n: [1, 2]}}")
    assert [tuple(row.values()) for row in spec] == [(4, 0.1, 1.0), (4, 0.2, 2.0)]


def test_ranges_have_equal_steps_or_equal_ratios() -> None:
    spec = parsed(
        "parameters: {case: {from: 1, to: 12, count: 12},"
        " tension_n: {from: 1, to: 8, count: 4, spacing: log}}"
    )
    assert spec.axes["case"] == tuple(range(1, 13))
    assert all(isinstance(value, int) for value in spec.axes["case"])
    assert spec.axes["tension_n"] == pytest.approx((1.0, 2.0, 4.0, 8.0))


def test_a_whole_number_is_a_float_where_a_float_is_declared() -> None:
    (value,) = parsed("parameters: {friction: 1}").axes["friction"]
    assert isinstance(value, float)


def test_samples_follow_their_seed_and_their_distribution() -> None:
    text = (
        "{{combine: zip, parameters: {{"
        "friction: {{random: uniform, low: 0.1, high: 0.3, count: 2000, seed: {seed}}}, "
        "young_mpa: {{random: normal, mean: 2.6, deviation: 0.1, count: 2000, seed: {seed}}}}}}}"
    )
    one, again, other = (parsed(text.format(seed=seed)).axes for seed in (1, 1, 2))
    assert one == again
    assert one["friction"] != other["friction"]
    friction, young = np.array(one["friction"]), np.array(one["young_mpa"])
    assert friction.min() >= 0.1
    assert friction.max() <= 0.3
    # Five standard errors of a mean over 2000 draws.
    error = 5.0 / math.sqrt(2000.0)
    assert friction.mean() == pytest.approx(0.2, abs=error * 0.2 / math.sqrt(12.0))
    assert young.mean() == pytest.approx(2.6, abs=error * 0.1)
    # The same seed for two parameters must not make them move together.
    assert abs(np.corrcoef(friction, young)[0, 1]) < error


def test_what_cannot_be_meant_is_refused_in_one_sentence() -> None:
    for text, sentence in [
        ("parameters: {fricton: 0.1}", "no parameter fricton; did you mean friction"),
        ("parameters: {12: 0.1}", "a name must be a word, got 12"),
        ("parameters: {friction: fast}", "friction must be a number, got 'fast'"),
        ("parameters: {friction: 1e-3}", "YAML wants a point in it"),
        ("parameters: {friction: true}", "friction must be a number, got True"),
        ("parameters: {friction: .nan}", "friction must be finite, got nan"),
        ("parameters: {friction: }", "friction must be a number, got None"),
        ("parameters: {case: 1.5}", "case must be a whole number, got 1.5"),
        ("parameters: {rolling: 1}", "rolling must be true or false, got 1"),
        ("parameters: {law: 3}", "law must be a word, got 3"),
        ("parameters: {friction: []}", "friction has an empty list"),
        ("parameters: {friction: [[0.1]]}", "friction must be a number"),
        ("parameters: {friction: {from: 1, to: 2}}", "friction lacks count"),
        ("parameters: {friction: {from: 1, to: 2, count: 3, step: 4}}", "has no word 'step'"),
        ("parameters: {friction: {from: 1, to: 2, count: 0}}", "count of friction must be"),
        ("parameters: {friction: {from: 1, to: x, count: 3}}", "to of friction must be a number"),
        (
            "parameters: {friction: {from: 0, to: 2, count: 3, spacing: log}}",
            "from and to must be positive",
        ),
        (
            "parameters: {friction: {from: 1, to: 2, count: 3, spacing: odd}}",
            "must be linear or log",
        ),
        ("parameters: {case: {from: 1, to: 2, count: 3}}", "but the range holds 1.5"),
        ("parameters: {law: {from: 1, to: 2, count: 3}}", "law is no number"),
        (
            "parameters: {friction: {random: flat, low: 1, high: 2, count: 3, seed: 1}}",
            "must be uniform or normal, got 'flat'",
        ),
        (
            "parameters: {friction: {random: uniform, low: 1, high: 2, count: 3}}",
            "friction lacks seed",
        ),
        (
            "parameters: {friction: {random: uniform, low: 2, high: 1, count: 3, seed: 1}}",
            "low of friction must not exceed high",
        ),
        (
            "parameters: {friction: {random: normal, mean: 1, deviation: -1, count: 3, seed: 1}}",
            "deviation of friction must not be negative",
        ),
        (
            "parameters: {case: {random: uniform, low: 1, high: 12, count: 3, seed: 1}}",
            "case is a whole number",
        ),
        ("{combine: zip, parameters: {friction: [1, 2], case: [1, 2, 3]}}", "friction 2, case 3"),
        ("{combine: mix, parameters: {case: 4}}", "combine must be grid or zip, got 'mix'"),
        ("{parameters: {case: 4}, seed: 1}", "it holds 'seed'"),
        ("parameters: {case: 4, case: 5}", "case stands twice"),
        ("parameters: {}", "names no parameter"),
        ("[1, 2]", "must hold a mapping named parameters"),
        ("parameters: {case: [4", "it is no YAML"),
        ("parameters: !!python/object/apply:os.getcwd []", "it is no YAML"),
        (
            "parameters: {friction: {from: 1, to: 2, count: 5000},"
            " tension_n: {from: 1, to: 2, count: 5000}}",
            "it has 25000000 runs, more than 1000000",
        ),
    ]:
        with pytest.raises(SpecError) as caught:
            parsed(text)
        assert sentence in str(caught.value)
        assert "\n" not in str(caught.value)
