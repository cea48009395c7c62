"""The store of finished runs: keys, damage, killed writers, several processes."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.cases import paper_case
from winding_study.run_store import RunStore, run_key, solver_sources, solver_version, write_whole

# Prints the project's modules that the solver brings into a fresh process.
LOADED = """
import sys, cable_fem_node.winding.prediction, cable_fem_node.winding.solid_winding
print(*(name for name in sys.modules if name.startswith(("cable_fem_node", "winding_core"))))
"""

KEY = run_key({"case": 4}, "v1")
PLAIN = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False)
VALUES = PLAIN | st.text() | st.lists(PLAIN)


@dataclass(frozen=True, kw_only=True)
class Cold:
    degrees: float


@dataclass(frozen=True, kw_only=True)
class Warm:
    degrees: float


@given(st.dictionaries(st.text(), VALUES))
def test_the_order_of_inputs_does_not_count(inputs: dict[str, object]) -> None:
    backwards = dict(reversed(inputs.items()))
    assert run_key(inputs, "v1") == run_key(backwards, "v1")


@given(st.floats(min_value=0.01, max_value=10.0))
def test_the_last_bit_of_an_input_counts(value: float) -> None:
    assert run_key({"x": value}, "v1") != run_key({"x": np.nextafter(value, 11.0)}, "v1")


def test_the_version_and_the_kind_of_an_input_count() -> None:
    assert run_key(Cold(degrees=1.0), "v1") != run_key(Cold(degrees=1.0), "v2")
    assert run_key(Cold(degrees=1.0), "v1") != run_key(Warm(degrees=1.0), "v1")


def test_a_model_has_a_key_that_follows_every_level() -> None:
    model = WindingConfig(case=paper_case(4))
    heavier = replace(model, case=replace(model.case, weight=model.case.weight + 0.1))
    assert run_key(model, "v1") == run_key(WindingConfig(case=paper_case(4)), "v1")
    assert run_key(model, "v1") != run_key(heavier, "v1")


def test_what_has_no_canonical_form_is_refused() -> None:
    with pytest.raises(ValueError, match="Out of range float"):
        run_key({"x": float("nan")}, "v1")
    with pytest.raises(TypeError, match="must be numbers and text, got a object"):
        run_key({"x": object()}, "v1")


@pytest.mark.slow
def test_the_version_covers_what_a_prediction_loads_and_no_adapter() -> None:
    names = set(solver_sources())
    loaded = subprocess.run(
        [sys.executable, "-c", LOADED], capture_output=True, text=True, check=True
    )
    files = {name.replace(".", "/") for name in loaded.stdout.split()}
    covered = {name.removesuffix(".py").removesuffix("/__init__") for name in names}
    assert files <= covered
    assert {"cable_fem_node/winding/winding_kernels.py", "winding_core/cable/cases.py"} <= names
    assert not any("/ros/" in name or name.endswith("/node.py") for name in names)
    assert len(solver_version()) == 16


def test_what_was_saved_is_loaded(tmp_path: Path, refusals: list[str]) -> None:
    store = RunStore(tmp_path)
    assert store.load(KEY, refusals.append) is None
    store.save(KEY, {"s": [0.1, 0.2], "status": "ok", "count": 3})
    found = store.load(KEY, refusals.append)
    assert found is not None
    assert found["s"].tolist() == [0.1, 0.2]
    assert (str(found["status"]), int(found["count"])) == ("ok", 3)
    assert not refusals


def test_a_cut_file_counts_as_missing_and_is_named(tmp_path: Path, refusals: list[str]) -> None:
    store = RunStore(tmp_path)
    path = store.path(KEY)
    lengths = (0, 1, 40, 200, -1)
    for kept in lengths:
        store.save(KEY, {"s": np.arange(50.0)})
        path.write_bytes(path.read_bytes()[:kept])
        assert store.load(KEY, refusals.append) is None
    assert len(refusals) == len(lengths)
    assert all(f"{path} is damaged and counts as missing" in sentence for sentence in refusals)
    store.save(KEY, {"s": np.arange(50.0)})
    assert store.load(KEY, refusals.append) is not None


def test_a_flipped_bit_in_the_numbers_is_seen(tmp_path: Path, refusals: list[str]) -> None:
    store = RunStore(tmp_path)
    numbers = np.linspace(0.1, 0.9, 50)
    store.save(KEY, {"s": numbers})
    path = store.path(KEY)
    content = bytearray(path.read_bytes())
    content[content.index(numbers[20:30].tobytes())] ^= 1
    path.write_bytes(content)
    assert store.load(KEY, refusals.append) is None
    assert "damaged" in refusals[0]


def test_a_file_of_another_run_counts_as_missing(tmp_path: Path, refusals: list[str]) -> None:
    store = RunStore(tmp_path)
    other = run_key({"case": 5}, "v1")
    store.save(other, {"s": 1.0})
    store.path(KEY).parent.mkdir(parents=True, exist_ok=True)
    os.replace(store.path(other), store.path(KEY))
    assert store.load(KEY, refusals.append) is None
    assert "holds another run" in refusals[0]


def test_a_pickle_is_never_opened(tmp_path: Path, refusals: list[str]) -> None:
    store = RunStore(tmp_path)
    store.path(KEY).parent.mkdir(parents=True)
    np.savez(store.path(KEY), s=np.array([{"code": "would run"}], dtype=object))
    assert store.load(KEY, refusals.append) is None
    assert "damaged" in refusals[0]
    with pytest.raises(ValueError, match="cannot be saved when allow_pickle=False"):
        store.save(KEY, {"s": np.array([{}], dtype=object)})


def test_a_failed_write_leaves_nothing(tmp_path: Path) -> None:
    def write(file: BinaryIO) -> None:
        file.write(b"half")
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        write_whole(tmp_path / "result", write)
    assert list(tmp_path.iterdir()) == []


def _write_half_and_die(path: Path) -> None:
    def write(file: BinaryIO) -> None:
        file.write(b"half")
        file.flush()
        os.kill(os.getpid(), signal.SIGKILL)

    write_whole(path, write)


@pytest.mark.slow
def test_a_killed_writer_leaves_no_run_and_is_cleaned_up(
    tmp_path: Path, refusals: list[str]
) -> None:
    store = RunStore(tmp_path)
    store.path(KEY).parent.mkdir(parents=True)
    writer = multiprocessing.get_context("spawn").Process(
        target=_write_half_and_die, args=(store.path(KEY),)
    )
    writer.start()
    writer.join()
    (left,) = store.path(KEY).parent.iterdir()
    assert store.load(KEY, refusals.append) is None
    assert not refusals
    written = left.stat().st_mtime
    assert store.remove_unfinished(before=written - 1.0) == 0
    assert store.remove_unfinished(before=written + 1.0) == 1
    assert not left.exists()


def _save_often(folder: Path, value: float) -> None:
    for _ in range(50):
        RunStore(folder).save(KEY, {"s": np.full(1000, value)})


@pytest.mark.slow
def test_processes_that_write_the_same_run_never_mix(tmp_path: Path, refusals: list[str]) -> None:
    context = multiprocessing.get_context("spawn")
    writers = [context.Process(target=_save_often, args=(tmp_path, float(n))) for n in (1, 2)]
    for writer in writers:
        writer.start()
    store = RunStore(tmp_path)
    while any(writer.is_alive() for writer in writers):
        found = store.load(KEY, refusals.append)
        assert found is None or np.unique(found["s"]).size == 1
    assert [writer.exitcode for writer in writers] == [0, 0]
    assert store.load(KEY, refusals.append) is not None
    assert not refusals


@pytest.fixture
def refusals() -> list[str]:
    return []
