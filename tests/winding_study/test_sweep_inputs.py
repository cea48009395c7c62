"""What a sweep reads and keeps: its YAML, and the store of finished runs."""

import math
import multiprocessing
import os
import signal
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cable_fem_node.winding.winding_config import WindingConfig
from processes import python
from winding_core.cable.cases import paper_case
from winding_study.run_store import RunStore, run_key, solver_sources, solver_version, write_whole
from winding_study.sweep.spec import SpecError, SweepSpec, parse_spec

KINDS = {
    "case": int,
    "friction": float,
    "tension_n": float,
    "young_mpa": float,
    "law": str,
    "rolling": bool,
}
# Prints the project's modules that the solver brings into a fresh process.
LOADED = """
import sys, cable_fem_node.winding.prediction, cable_fem_node.winding.solid_winding
print(*(name for name in sys.modules if name.startswith(("cable_fem_node", "winding_core"))))
"""
KEY = run_key({"case": 4}, "v1")
PLAIN = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False)
VALUES = PLAIN | st.text() | st.lists(PLAIN)


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


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        *((f"parameters: {{{text}}}", sentence) for text, sentence in (
            ("fricton: 0.1", "no parameter fricton; did you mean friction"),
            ("12: 0.1", "a name must be a word, got 12"),
            ("friction: fast", "friction must be a number, got 'fast'"),
            ("friction: 1e-3", "YAML wants a point in it"),
            ("friction: true", "friction must be a number, got True"),
            ("friction: .nan", "friction must be finite, got nan"),
            ("friction: ", "friction must be a number, got None"),
            ("case: 1.5", "case must be a whole number, got 1.5"),
            ("rolling: 1", "rolling must be true or false, got 1"),
            ("law: 3", "law must be a word, got 3"),
            ("friction: []", "friction has an empty list"),
            ("friction: [[0.1]]", "friction must be a number"),
            ("friction: {from: 1, to: 2}", "friction lacks count"),
            ("friction: {from: 1, to: 2, count: 3, step: 4}", "has no word 'step'"),
            ("friction: {from: 1, to: 2, count: 0}", "count of friction must be"),
            ("friction: {from: 1, to: x, count: 3}", "to of friction must be a number"),
            ("friction: {from: 0, to: 2, count: 3, spacing: log}", "from and to must be positive"),
            ("friction: {from: 1, to: 2, count: 3, spacing: odd}", "must be linear or log"),
            ("case: {from: 1, to: 2, count: 3}", "but the range holds 1.5"),
            ("law: {from: 1, to: 2, count: 3}", "law is no number"),
            ("friction: {random: flat, low: 1, high: 2, count: 3, seed: 1}",
             "must be uniform or normal, got 'flat'"),
            ("friction: {random: uniform, low: 1, high: 2, count: 3}", "friction lacks seed"),
            ("friction: {random: uniform, low: 2, high: 1, count: 3, seed: 1}",
             "low of friction must not exceed high"),
            ("friction: {random: normal, mean: 1, deviation: -1, count: 3, seed: 1}",
             "deviation of friction must not be negative"),
            ("case: {random: uniform, low: 1, high: 12, count: 3, seed: 1}",
             "case is a whole number"),
            ("case: 4, case: 5", "case stands twice"),
            ("friction: {from: 1, to: 2, count: 5000}, tension_n: {from: 1, to: 2, count: 5000}",
             "it has 25000000 runs, more than 1000000"),
        )),
        ("{combine: zip, parameters: {friction: [1, 2], case: [1, 2, 3]}}", "friction 2, case 3"),
        ("{combine: mix, parameters: {case: 4}}", "combine must be grid or zip, got 'mix'"),
        ("{parameters: {case: 4}, seed: 1}", "it holds 'seed'"),
        ("parameters: {}", "names no parameter"),
        ("[1, 2]", "must hold a mapping named parameters"),
        ("parameters: {case: [4", "it is no YAML"),
        ("parameters: !!python/object/apply:os.getcwd []", "it is no YAML"),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_refused_in_one_sentence(text: str, sentence: str) -> None:
    with pytest.raises(SpecError) as caught:
        parsed(text)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


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
    files = {name.replace(".", "/") for name in python(LOADED, check=True).stdout.split()}
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
def test_a_killed_writer_leaves_no_run_and_is_cleaned(tmp_path: Path, refusals: list[str]) -> None:
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
