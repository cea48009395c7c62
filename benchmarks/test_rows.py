"""What bench.json holds after several sessions."""

from __future__ import annotations

import json

import pytest

from rows import Bench, keep


def test_rows_of_earlier_sessions_stay(tmp_path):
    path = tmp_path / "bench.json"
    for session in ({"a": 1.0, "b": 2.0}, {"b": 3.0, "c": 4.0}):
        bench = Bench()
        for name, value in session.items():
            bench.row(name, value, "s", bar=10.0)
        keep(bench.rows.values(), path)
    assert json.loads(path.read_text(encoding="utf-8")) == [
        {"name": "a", "value": 1.0, "unit": "s"},
        {"name": "b", "value": 3.0, "unit": "s"},
        {"name": "c", "value": 4.0, "unit": "s"},
    ]
    assert list(tmp_path.iterdir()) == [path]


def test_number_that_is_not_finite_leaves_the_file_alone(tmp_path):
    path = tmp_path / "bench.json"
    keep([Bench().row("a", 1.0, "s")], path)
    before = path.read_bytes()
    with pytest.raises(ValueError, match="not JSON compliant"):
        keep([Bench().row("b", float("nan"), "s")], path)
    assert path.read_bytes() == before


def test_bar_is_a_ceiling_unless_it_is_a_floor():
    bench = Bench()
    assert bench.row("at the ceiling", 2.0, "s", bar=2.0).met
    assert not bench.row("over the ceiling", 2.1, "s", bar=2.0).met
    assert bench.row("over the floor", 2.1, "Hz", bar=2.0, at_least=True).met
    assert not bench.row("under the floor", 1.9, "Hz", bar=2.0, at_least=True).met
    assert not bench.row("not a number", float("nan"), "s", bar=2.0).met


def test_ratio_keeps_both_processor_times_and_the_load(tmp_path):
    path = tmp_path / "bench.json"
    keep([Bench().ratio("a", 3.0, 2.0, bar=2.0)], path)
    (entry,) = json.loads(path.read_text(encoding="utf-8"))
    assert entry["value"] == 1.5
    assert entry["cpu_s"] == [3.0, 2.0]
    assert entry["load"] >= 0.0
