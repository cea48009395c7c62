"""The truth file: the lay as it was wound, and what was hidden from everything that measures it."""

import json
from pathlib import Path

import numpy as np
import pytest

from winding_core.cable.cases import paper_case
from winding_core.helix import PAPER_FREE_LENGTH
from winding_core.machine.drive import DriveProfile
from winding_rig_node.lay.driven_lay import DrivenLay
from winding_rig_node.lay.known_lay import published_lay
from winding_rig_node.lay.lay_on import HiddenRig
from winding_rig_node.lay.truth import truth_path, truth_record, write_truth

CASE = paper_case(4)


def test_the_truth_of_a_driven_lay_is_the_lay_and_what_was_hidden(tmp_path: Path) -> None:
    hidden = HiddenRig.drawn(np.random.default_rng(2))
    lay = DrivenLay(CASE, hidden)
    for angle in np.arange(0.01, 14.0, 0.01):
        lay.advance(angle, 3.0e-3 * angle, CASE.weight)
    write_truth(tmp_path / "truth.json", truth_record(lay.truth(99.0)))
    written = json.loads((tmp_path / "truth.json").read_text())
    assert HiddenRig(**written["hidden"]) == hidden
    assert written["wound_angle"] == lay.wound_angle == written["path"]["theta"][-1]
    theta = np.array(written["path"]["theta"])
    np.testing.assert_array_equal(written["path"]["z"], lay.z_at(theta))
    # The lay's own, at the markers: so many spacings.
    length = np.interp(lay.marker_theta[:3], theta, written["path"]["length"])
    np.testing.assert_allclose(length, CASE.marker_spacing * np.arange(3), rtol=0, atol=1.0e-6)
    assert written["markers"]["theta"] == [*lay.marker_theta[:3].tolist(), None, None]
    assert written["markers"]["z"][3:] == [None, None]
    assert [path.name for path in tmp_path.iterdir()] == ["truth.json"]


def test_the_truth_of_a_known_lay_ends_where_the_cylinder_stands() -> None:
    lay = published_lay(CASE, DriveProfile(), PAPER_FREE_LENGTH, 33.93)
    written = truth_record(lay.truth(8.0))
    assert written["hidden"] == {}
    assert max(written["path"]["theta"]) <= 8.0
    assert written["markers"]["theta"] == [0.0, lay.marker_theta[1], None, None, None]


def test_an_empty_name_is_no_file() -> None:
    assert truth_path("") is None


@pytest.mark.parametrize("name", ["absent/truth.json", "."])
def test_a_bad_file_is_refused(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=f"a file in a folder that exists, got '{name}'"):
        truth_path(name)
