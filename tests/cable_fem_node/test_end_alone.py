"""A prediction of the end alone is the end of the whole prediction."""

from __future__ import annotations

import numpy as np

from winding_study.run_parameters import RunParameters


def test_the_end_alone_is_the_last_record_of_the_whole_history() -> None:
    run = RunParameters.from_typed({"case": 4, "duration_s": 0.5}).plan()
    whole, end = run.wind(), run.wind(whole=False)
    assert end.history.shape == (1, whole.history.shape[1])
    np.testing.assert_array_equal(end.markers, whole.markers)
    assert end.duration == whole.duration
