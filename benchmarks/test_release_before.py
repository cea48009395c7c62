"""The recorded graph of case 4 beside that of the release before, in turn, twice."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from floors.release import ROOT, release_before, unpacked
from floors.whole_graph import warm_up, wind

PAIRS, DURATION = 2, 14.0
NEW_OVER_OLD = 0.8


@pytest.mark.timeout(900)
def test_graph_beside_that_of_the_release_before(
    bench: Any, tmp_path: Path, pytestconfig: pytest.Config
) -> None:
    commit = release_before()
    if commit is None:
        pytest.skip("the history of this checkout does not reach the release before (shallow?)")
    kept = pytestconfig.cache.mkdir("releases") if pytestconfig.cache is not None else tmp_path
    fresh = not (kept / commit).exists()
    before = unpacked(commit, kept)
    if fresh:
        # Its kernels are compiled before anything is measured.
        warm_up(before, tmp_path / "warm")
    pairs = []
    for pair in range(PAIRS):
        costs = []
        for name, checkout in (("new", ROOT), ("old", before)):
            folder = tmp_path / f"{name}{pair}"
            costs.append(wind(checkout, folder, DURATION))
            shutil.rmtree(folder)
            parts = ", ".join(f"{part} {used:.3f}" for part, used in costs[-1].by_process.items())
            print(f"{name} {costs[-1].total:.3f} CPU s/s, load {costs[-1].load:.1f}: {parts}")
        pairs.append((costs[0].total, costs[1].total))
    new, old = np.array(pairs).T
    bench.ratio(
        "graph_over_release_before",
        float(new.mean()),
        float(old.mean()),
        bar=NEW_OVER_OLD,
        value=float((new / old).mean()),
    )
