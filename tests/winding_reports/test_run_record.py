from __future__ import annotations

import dataclasses
import json
import math
from importlib.resources import files

import numpy as np
import pytest

from winding_reports.records.run_record import (
    MarkerRow,
    MarkerSeries,
    Signal,
    run_json,
    write_run_json,
)

SCHEMA = json.loads((files("winding_reports") / "schemas" / "run.json").read_text("utf-8"))


def _refuse_constant(name: str) -> None:
    raise AssertionError(f"{name} is not JSON")


def test_the_file_holds_exactly_the_agreed_keys(synthetic, tmp_path) -> None:
    path = tmp_path / "new" / "run.json"
    write_run_json(synthetic(), path)
    read = json.loads(path.read_text(encoding="utf-8"), parse_constant=_refuse_constant)
    assert set(read) == set(SCHEMA["required"])
    assert read["case"] == 4
    assert [marker["id"] for marker in read["markers"]] == [1, 2, 3, 4]
    marker_keys = set(SCHEMA["properties"]["markers"]["items"]["required"])
    assert all(set(marker) == marker_keys for marker in read["markers"])
    assert (read["frames"], read["joint_states_lost"], read["sim_s"]) == (4000, 0, 20.0)


def test_errors_are_the_tables_measure(synthetic) -> None:
    row = MarkerRow(id=1, original=0.1, s_fem=0.125, s_corrected=0.1, s_published=0.11)
    written = run_json(dataclasses.replace(synthetic(), rows=(row,)))["markers"][0]
    # 100 |0.11 - 0.125| / 0.125 and 100 |0.11 - 0.1| / 0.1, exact up to rounding.
    assert written["error_fem_pct"] == pytest.approx(12.0, rel=1e-12)
    assert written["error_corrected_pct"] == pytest.approx(10.0, rel=1e-12)


def test_what_was_not_measured_is_null(synthetic, tmp_path) -> None:
    row = MarkerRow(id=1, original=0.1, s_fem=math.nan, s_tracked=math.inf)
    record = dataclasses.replace(
        synthetic(), rows=(row,), frames=None, frames_lost=None, wall_s=None, sim_s=math.nan
    )
    path = tmp_path / "run.json"
    write_run_json(record, path)
    read = json.loads(path.read_text(encoding="utf-8"), parse_constant=_refuse_constant)
    assert read["markers"][0].pop("id") == 1
    assert read["markers"][0].pop("original_m") == 0.1
    assert set(read["markers"][0].values()) == {None}
    assert [read[name] for name in ("frames", "frames_lost", "wall_s", "sim_s")] == [None] * 4


def test_an_error_needs_a_length_to_divide_by() -> None:
    assert MarkerRow(id=1, original=0.1, s_fem=0.0, s_published=0.1).error_fem_pct is None


def test_numbers_of_numpy_are_written_too(synthetic) -> None:
    row = MarkerRow(id=1, original=0.1, s_fem=np.float64(0.11), h=np.float32(0.5))
    json.dumps(run_json(dataclasses.replace(synthetic(), rows=(row,))))


def test_a_series_gives_one_markers_rows() -> None:
    series = MarkerSeries(
        t=np.array([0.0, 0.0, 1.0]),
        id=np.array([1, 2, 1]),
        theta=np.array([6.0, 12.0, 6.1]),
        z=np.zeros(3),
        s=np.ones(3),
    )
    assert series.of(1).theta.tolist() == [6.0, 6.1]
    assert series.of(3).t.size == 0


def test_series_of_unequal_length_are_refused() -> None:
    with pytest.raises(ValueError, match="one value per stamp"):
        Signal(t=np.zeros(3), value=np.zeros(2))
    with pytest.raises(ValueError, match="theta needs one value per stamp"):
        MarkerSeries(
            t=np.zeros(2), id=np.zeros(2, int), theta=np.zeros(3), z=np.zeros(2), s=np.zeros(2)
        )
