"""The cable lands where it is commanded, under rigs that are hidden from the controller.

The study takes 40 minutes of processor time and its result is on file, in `data/`:

    winding study --closed-loop --draws 20 --json closed_loop.json
    winding study --closed-loop --draws 5 --brake --json closed_loop_brake.json

What is promised is judged on the whole of it; one case of it is wound anew.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from winding_verification.closed_loop.study import (
    ClosedLoopConfig,
    ClosedLoopRow,
    closed_loop_study,
    miss_summary,
    summary,
    verdict,
)

DATA = Path(__file__).parent / "data"
# Of the twelve, those that are on file.
CASES = {"closed_loop.json": set(range(1, 13)), "closed_loop_brake.json": {4}}
SAMPLE = 4
TRUTHS = ["driven", "rod"]


def on_file(name: str, truth: str, mode: str = "closed") -> list[dict[str, Any]]:
    """Return the records of a study's runs; missing numbers are nan."""
    text = (DATA / name).read_text(encoding="utf-8").replace("null", "NaN")
    rows = [row for row in json.loads(text) if (row["truth"], row["mode"]) == (truth, mode)]
    assert {row["case"] for row in rows} == CASES[name]
    return rows


def column(rows: list[dict[str, Any]], name: str, number: int) -> np.ndarray:
    values = np.array([row[name][number] for row in rows if len(row[name]) > number])
    known = values[np.isfinite(values)]
    assert known.size > 0.9 * values.size > 0
    return known


def studied(config: ClosedLoopConfig) -> list[ClosedLoopRow]:
    """Wind a study in this process."""
    return closed_loop_study(config, processes=1, progress=lambda _done, _runs: None)


@pytest.fixture(scope="module")
def rows() -> list[ClosedLoopRow]:
    """One case, one hidden rig, both truths, closed and open."""
    return studied(ClosedLoopConfig(cases=(SAMPLE,), draws=1))


@pytest.mark.parametrize("truth", TRUTHS)
def test_the_cable_lies_on_the_helix_under_twenty_hidden_rigs_of_each_case(truth: str) -> None:
    closed = on_file("closed_loop.json", truth)
    assert len(closed) == 20 * len(CASES["closed_loop.json"])
    for number, bar in enumerate((1.0, 1.0, 0.5, 0.5)):
        error = np.abs(column(closed, "marker_error_mm", number))
        assert np.mean(error < bar) >= 0.95, f"P{number + 1}"
    turns = np.concatenate([row["turn_rms_mm"][2:] for row in closed])
    assert np.mean(turns < 0.5) >= 0.95


@pytest.mark.parametrize("truth", TRUTHS)
def test_markers_land_at_their_angles_or_it_was_predicted(truth: str) -> None:
    closed = on_file("closed_loop_brake.json", truth)
    assert len(closed) == 5 * len(CASES["closed_loop_brake.json"])
    for number, bar in enumerate((0.02, 0.01, 0.01, 0.01)):
        miss, expected = np.abs(
            [
                (row["marker_miss_turns"][number], row["said_miss_turns"][number])
                for row in closed
                if len(row["marker_miss_turns"]) > number
            ]
        ).T
        known = np.isfinite(miss)
        assert known.sum() > 0.9 * miss.size > 0
        # Two deviations hold 95 % of what is drawn.
        assert np.mean(miss[known] <= np.maximum(expected[known], bar)) >= 0.95, f"P{number + 1}"


@pytest.mark.slow
def test_the_file_has_what_is_wound_today(rows: list[ClosedLoopRow]) -> None:
    assert rows
    for row in rows:
        (kept,) = (
            kept
            for kept in on_file("closed_loop.json", row.truth, row.mode)
            if (kept["case"], kept["seed"]) == (row.case, row.seed)
        )
        now = row.record()
        # The file has micrometres; an explicit rod that sticks and slips repeats to some of them.
        for name in ("marker_error_mm", "turn_rms_mm"):
            assert now[name] == pytest.approx(kept[name], abs=0.02, nan_ok=True)


@pytest.mark.slow
@pytest.mark.parametrize("truth", TRUTHS)
def test_markers_land_on_the_helix(rows: list[ClosedLoopRow], truth: str) -> None:
    by_mode = {row.mode: row for row in rows if row.truth == truth}
    closed = by_mode["closed"]
    error = np.abs(closed.marker_error)
    # What a cell is promised: 1 mm at P1, 0.5 mm from P2 on, and 0.5 mm rms of later turns.
    assert error[0] < 1.0e-3
    assert (error[1:] < 0.5e-3).all()
    assert (closed.turn_rms[2:] < 0.5e-3).all()
    # The open loop is an order of magnitude off.
    assert (np.abs(by_mode["open"].marker_error) > 10.0 * error).all()


@pytest.mark.slow
def test_the_estimated_free_length_is_that_of_the_rig(rows: list[ClosedLoopRow]) -> None:
    (closed,) = (row for row in rows if (row.truth, row.mode) == ("driven", "closed"))
    off = closed.estimated_length - closed.free_length
    assert abs(off) < 3.0 * closed.sigma_length


@pytest.mark.slow
def test_a_summary_and_a_verdict_are_those_of_the_rows(rows: list[ClosedLoopRow]) -> None:
    found = summary(rows)
    assert set(found) == {(truth, mode) for truth in TRUTHS for mode in ("closed", "open")}
    for parts in found.values():
        assert set(parts) == {"P1", "P2", "P3", "P4", "turns"}
        assert all((np.diff(values) >= 0.0).all() for values in parts.values())
    worst = max(row.turn_rms[2:].max() for row in rows if row.mode == "closed")
    sentence = verdict(rows, 0.5e-3)
    assert sentence.startswith("good: ")
    assert f" {1e3 * worst:.2f} mm (rms)" in sentence
    assert verdict(rows, 0.99 * worst).startswith("not good: ")


@pytest.mark.slow
def test_a_brake_lands_markers_where_they_are_wanted() -> None:
    rows = studied(ClosedLoopConfig(cases=(SAMPLE,), draws=1, truths=("driven",), brake=True))
    (closed,) = (row for row in rows if row.mode == "closed")
    assert closed.marker_miss.shape == closed.expected_miss.shape == (4,)
    # What a cell is promised where the pull reaches: 2 % of a turn at P1, 1 % from P2 on.
    bars = 2.0 * np.pi * np.array([0.02, 0.01, 0.01, 0.01])
    assert (np.abs(closed.marker_miss) < bars).all()
    (parts,) = miss_summary(rows).values()
    assert all(parts[f"P{n} expected"] == 1.0 for n in range(1, 5))
