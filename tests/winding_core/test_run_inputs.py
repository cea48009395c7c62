"""The inputs of a run as a file."""

from pathlib import Path

import numpy as np
import pytest

from winding_core.run_inputs import INPUT_DTYPE, RunInputs, RunInputsError


def inputs(count: int = 5) -> RunInputs:
    samples = np.zeros(count, dtype=INPUT_DTYPE)
    samples["t"] = np.arange(count)
    samples["cylinder_angle"] = 2.0 * samples["t"]
    samples["tension"] = [np.nan, *np.full(count - 1, 3.0)]
    return RunInputs(samples=samples)


def test_file_gives_back_what_was_written(tmp_path: Path) -> None:
    file = tmp_path / "inputs.npy"
    inputs().write(file)
    assert RunInputs.read(file).samples.tobytes() == inputs().samples.tobytes()


def test_tension_that_was_not_read_is_none() -> None:
    rows = list(inputs())
    assert [tension for _, _, tension in rows] == [None, 3.0, 3.0, 3.0, 3.0]
    assert rows[2][1].cylinder_angle == 4.0


def test_times_that_do_not_ascend_are_refused() -> None:
    with pytest.raises(RunInputsError, match="must ascend"):
        RunInputs(samples=inputs().samples[::-1])


def test_pickled_objects_are_never_loaded(tmp_path: Path) -> None:
    file = tmp_path / "inputs.npy"
    np.save(file, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(RunInputsError, match="holds no inputs of a run"):
        RunInputs.read(file)
