"""What made-up inputs have found, each once and plainly."""

from pathlib import Path
from typing import Any

import pytest
from made_up import write_database

from correction_node.models.dataset import parse_lengths
from marker_tracker_node.camera.calibration import CalibrationError, read_camera
from marker_tracker_node.camera.frame_sources import FrameSource
from marker_tracker_node.camera.recordings import RecordingError
from winding_core.parameters import ParameterError, build
from winding_core.run_inputs import RunInputs, RunInputsError
from winding_core.yaml_text import YamlTextError, load_yaml
from winding_recorder.bags.contents import contents
from winding_recorder.bags.description import BagError
from winding_recorder.bags.tables import export
from winding_rig_node.ros.parameters import RigParameters
from winding_ros.runtime.parameter_files import parameters_for
from winding_study.identification.sources import SourceError, read_readings
from winding_study.sweep.spec import SpecError, parse_spec


def given(folder: Path, content: str | bytes) -> Path:
    path = folder / "given"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a: &a [1]\nb: *a", "an alias stands in line 2: write the value out"),
        ("[" * 500, "it is nested too deeply"),
        ("x: !!int ''", "a value does not fit its tag: string index out of range"),
        ("x: !!bool perhaps", "a value does not fit its tag: 'perhaps'"),
    ],
)
def test_yaml_errors_of_other_kinds_got_through(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises(YamlTextError) as refused:
        load_yaml(text)
    assert str(refused.value) == sentence
    with pytest.raises(ValueError, match="is not a parameter file"):
        parameters_for(given(tmp_path, text), "/winding/cable_fem")
    with pytest.raises(CalibrationError, match="is not YAML"):
        read_camera(given(tmp_path, text))
    with pytest.raises(SpecError, match="it is no YAML"):
        parse_spec(text, {"case": int})


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"speed": 10**400}, "parameter speed must be finite, got 1000"),
        ({"seed": 2**63}, "parameter seed must be finite, got 9223372036854775808"),
        ({"case": 10**5000}, "parameter case must be finite, got a number of thousands of digits"),
        ({"a\nb": 1}, r"winding_rig has no parameter 'a\nb'; did you mean"),
    ],
)
def test_a_parameter_was_refused_by_another_error(values: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ParameterError) as refused:
        build(RigParameters, values, owner="winding_rig")
    assert str(refused.value).startswith(sentence)


def test_a_long_value_was_repeated_as_a_whole() -> None:
    with pytest.raises(ParameterError) as refused:
        build(RigParameters, {"speed": "x" * 100_000}, owner="winding_rig")
    assert len(str(refused.value)) < 300


@pytest.mark.parametrize("text", ["x\n1", "file,t\na.png", "file,t\na.png,nan", "file,t\na.png,x"])
def test_a_list_of_frames_was_believed(tmp_path: Path, text: str) -> None:
    (tmp_path / "frames.csv").write_text(text, encoding="utf-8")
    with pytest.raises(RecordingError, match=r"frames\.csv"):
        list(FrameSource(tmp_path))


def test_cells_without_a_heading_were_joined(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"row 1 of .* has more cells than the head line"):
        read_readings(given(tmp_path, "a\n1,2"))


def test_lengths_of_another_csv_error() -> None:
    with pytest.raises(ValueError, match="x is no CSV text"):
        parse_lengths('case,marker,s_fem_m\n"' + "a" * 140_000, source="x")


@pytest.mark.parametrize(
    "content",
    [
        b"PK\x03\x04",
        b"\x93NUMPY\x01\x00\x46\x00"
        + b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000000,)}".ljust(70),
    ],
)
def test_a_damaged_file_of_inputs_raised_what_it_liked(tmp_path: Path, content: bytes) -> None:
    with pytest.raises(RunInputsError, match="holds no inputs of a run"):
        RunInputs.read(given(tmp_path, content))


@pytest.mark.parametrize("name", [None, 7, "/a\x00b"])
def test_a_database_named_a_topic_by_anything(tmp_path: Path, name: Any) -> None:
    file = tmp_path / "bag_0.db3"
    write_database(
        file,
        topics=[(1, name, "std_msgs/msg/Header", "cdr", "", "")],
        messages=[(1, 1, -5, 99999999999)],
    )
    with pytest.raises(BagError):
        contents(file)
    with pytest.raises(BagError):
        export(file, tmp_path / "tables", "csv")
