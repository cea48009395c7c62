"""Made-up files: each is read or refused in one sentence, and nothing is run.

A reader that a file could keep busy without end runs into the time limit of every test.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import example, given, settings
from hypothesis import strategies as st

from cable_fem_node.identification.tracked_run import IdentificationError
from correction_node.models.dataset import parse_lengths
from marker_tracker_node.camera.calibration import CalibrationError, read_camera
from marker_tracker_node.camera.frame_sources import FrameSource
from marker_tracker_node.camera.recordings import RecordingError, read_motion
from winding_core.parameters import ParameterError, build
from winding_core.run_inputs import RunInputs, RunInputsError
from winding_core.yaml_text import YamlTextError, load_yaml
from winding_rig_node.ros.parameters import RigParameters
from winding_ros.runtime.parameter_files import parameters_for
from winding_study.identification.sources import SourceError, read_readings, read_tensile_test
from winding_study.sweep.spec import SpecError, parse_spec

pytestmark = pytest.mark.slow
fuzzed = settings.get_profile("quick")
NODE = "/winding/winding_rig"
KINDS = {"case": int, "friction": float, "law": str, "rolling": bool}

BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{chr(98 + k)}: &{chr(98 + k)} [{', '.join([f'*{chr(97 + k)}'] * 9)}]\n" for k in range(12)
)
MAPPING_BOMB = "a: &a {ros__parameters: {x: 1}}\n" + "".join(
    f"{chr(98 + k)}: &{chr(98 + k)} {{p: *{chr(97 + k)}, q: *{chr(97 + k)}}}\n" for k in range(24)
)
NASTY = (
    BOMB,
    MAPPING_BOMB,
    "&a [*a]",
    # Deeper than Python's stack, and no deeper: the reader looks at every open bracket again.
    "[" * 500,
    "{a: " * 500,
    "- " * 500,
    "? " * 500,
    "x: " + "9" * 100_000,
    "x: 1e999",
    "x: !!int ''",
    "x: !!int abc",
    "x: !!float ''",
    "x: !!bool perhaps",
    "x: !!timestamp never",
    "x: 2001-99-99",
    "x: !!binary '*'",
    "x: =",
    "? [1]\n: 2",
    "? {a: 1}\n: 2",
    "<<: 1",
    "a: 1\n--- \nb: 2",
    "\x00",
    "\ufeff",
    "%YAML 9.9\n---\na",
)
RUNS_CODE = (
    "!!python/object/apply:os.system ['touch {mark}']",
    "!!python/object/new:os.system ['touch {mark}']",
    "!!python/object/apply:subprocess.check_call [[touch, {mark}]]",
    "!!python/name:os.system ''",
    "!!python/module:os ''",
)
CAMERA = {
    "image_width": 640,
    "image_height": 480,
    "camera_matrix": {"rows": 3, "cols": 3, "data": [500.0, 0, 320, 0, 500.0, 240, 0, 0, 1]},
    "distortion_model": "plumb_bob",
    "distortion_coefficients": {"rows": 1, "cols": 5, "data": [0.0] * 5},
    "roi": {"x_offset": 0, "y_offset": 0, "width": 640, "height": 480},
    "binning": 1,
}

scalars = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.sampled_from([10**400, -(10**400), 0, 1, 2**63]),
    st.floats(),
    st.text(max_size=12),
    st.binary(max_size=6),
)
documents = st.recursive(
    scalars,
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.dictionaries(st.one_of(st.text(max_size=8), st.integers()), inner, max_size=4),
    ),
    max_leaves=12,
)
texts = st.one_of(
    st.text(max_size=200),
    st.text(st.sampled_from("-[]{}:,&*!?|>'\"%@`# \n\tab1.e=<~"), max_size=80),
    documents.map(yaml.safe_dump),
)


def refusal_of(action: Callable[[], Any], *errors: type[Exception]) -> str:
    try:
        action()
        return ""
    except errors as error:
        sentence = str(error)
        assert sentence
        assert "\n" not in sentence
        assert len(sentence) < 2000
        return sentence


def written(folder: Path, content: str | bytes) -> Path:
    path = folder / "given"
    path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8", "replace"))
    return path


def wound(file: Path) -> RigParameters:
    return build(RigParameters, parameters_for(file, NODE), owner="winding_rig")


READERS: dict[str, tuple[Callable[[Path], Any], tuple[type[Exception], ...]]] = {
    "parameters": (wound, (ValueError,)),
    "sweep": (lambda path: parse_spec(path.read_text("utf-8"), KINDS), (SpecError,)),
    "camera": (read_camera, (CalibrationError,)),
    "motion": (read_motion, (RecordingError,)),
    "markers": (read_readings, (SourceError, IdentificationError)),
    "tensile": (read_tensile_test, (SourceError, IdentificationError)),
    "lengths": (lambda path: parse_lengths(path.read_text("utf-8"), source="given"), (ValueError,)),
}
# These are given as text by a command that refuses a file that is no UTF-8 itself.
READS_TEXT = {"sweep", "lengths"}
by_reader = pytest.mark.parametrize("reader", READERS)


@by_reader
def test_nasty_texts_are_refused_in_a_sentence(reader: str, tmp_path: Path) -> None:
    read, errors = READERS[reader]
    for text in NASTY:
        refusal_of(lambda text=text: read(written(tmp_path, text)), *errors)


@pytest.mark.parametrize("reader", ["parameters", "sweep", "camera"])
def test_tags_that_name_code_run_nothing(reader: str, tmp_path: Path) -> None:
    assert RUNS_CODE
    mark = tmp_path / "mark"
    read, errors = READERS[reader]
    for code in RUNS_CODE:
        for around in ("{}", "x: {}", "parameters: {{friction: {}}}", "/**: {}"):
            text = around.format(code.format(mark=mark))
            sentence = refusal_of(lambda text=text: read(written(tmp_path, text)), *errors)
            assert "could not determine a constructor" in sentence, text
            assert not mark.exists(), text


@by_reader
@fuzzed
@given(text=texts)
def test_any_text(reader: str, text: str, tmp_path: Path) -> None:
    read, errors = READERS[reader]
    refusal_of(lambda: read(written(tmp_path, text)), *errors)


@by_reader
@fuzzed
@given(content=st.binary(max_size=120))
def test_any_bytes(reader: str, content: bytes, tmp_path: Path) -> None:
    read, errors = READERS[reader]
    more = (UnicodeDecodeError,) if reader in READS_TEXT else ()
    refusal_of(lambda: read(written(tmp_path, content)), *errors, *more)


@fuzzed
@given(document=documents)
def test_any_document_comes_back_as_it_was(document: Any) -> None:
    text = yaml.safe_dump(document, allow_unicode=True)
    refused = refusal_of(lambda: load_yaml(text), YamlTextError)
    if not refused:
        assert repr(load_yaml(text)) == repr(yaml.safe_load(text))
    elif "alias" not in refused:
        # Python writes whole numbers of more than 4300 digits no more than it reads them.
        with pytest.raises((ValueError, yaml.YAMLError)):
            yaml.safe_load(text)


def test_a_long_text_is_not_read() -> None:
    assert "more than" in refusal_of(lambda: load_yaml("x" * 1_000_001), YamlTextError)


@fuzzed
@given(
    values=st.dictionaries(
        st.one_of(st.sampled_from(sorted(RigParameters.__dataclass_fields__)), st.text(max_size=8)),
        documents,
        max_size=4,
    )
)
def test_any_values_of_known_parameters(values: dict[str, Any]) -> None:
    sentence = refusal_of(lambda: build(RigParameters, values, owner="winding_rig"), ParameterError)
    if not sentence:
        made = build(RigParameters, values, owner="winding_rig")
        assert made.speed >= 0.0
        refusal_of(made.resolved, ParameterError)


FAR_APART = {"random": "uniform", "low": -1e308, "high": 1e308, "count": 1, "seed": 1}


@fuzzed
@given(content=st.dictionaries(st.sampled_from(["parameters", "combine", "x"]), documents))
@example({"parameters": {"friction": {"random": [], "low": 1, "high": 2, "count": 1, "seed": 1}}})
@example({"parameters": {"friction": 10**400}})
@example({"parameters": {"friction": {"from": -1e308, "to": 1e308, "count": 3}}})
@example({"parameters": {"friction": FAR_APART}})
def test_any_sweep(content: dict[str, Any]) -> None:
    check_sweep(content)


axis = st.one_of(
    documents,
    st.fixed_dictionaries(
        {"from": scalars, "to": scalars, "count": st.integers(-1, 50)},
        optional={"spacing": st.one_of(st.sampled_from(["linear", "log"]), scalars)},
    ),
    st.fixed_dictionaries(
        {"random": st.just("uniform"), "low": scalars, "high": scalars},
        optional={"count": st.integers(0, 9), "seed": scalars},
    ),
    st.fixed_dictionaries(
        {"random": st.just("normal"), "mean": scalars, "deviation": scalars},
        optional={"count": st.integers(0, 9), "seed": scalars},
    ),
)


@fuzzed
@given(
    axes=st.dictionaries(st.sampled_from([*KINDS, "frictoin"]), axis, min_size=1, max_size=3),
    combine=st.sampled_from(["grid", "zip", "", 1]),
)
def test_any_axes(axes: dict[str, Any], combine: Any) -> None:
    check_sweep({"parameters": axes, "combine": combine})


def check_sweep(content: Any) -> None:
    text = yaml.safe_dump(content)
    if refusal_of(lambda: parse_spec(text, KINDS), SpecError):
        return
    for row in parse_spec(text, KINDS):
        for name, value in row.items():
            assert isinstance(value, KINDS[name])
            assert not isinstance(value, float) or math.isfinite(value)


@fuzzed
@given(
    changed=st.dictionaries(
        st.sampled_from([*CAMERA, "camera_matrix.data", "roi.width"]), documents
    )
)
@example(changed={"image_width": math.inf})
@example(changed={"camera_matrix.data": [10**400] * 9})
@example(changed={"distortion_coefficients": {"data": [1e300] * 5}})
def test_any_camera(changed: dict[str, Any], tmp_path: Path) -> None:
    content: dict[str, Any] = {k: dict(v) if isinstance(v, dict) else v for k, v in CAMERA.items()}
    for name, value in changed.items():
        outer, _, inner = name.partition(".")
        if inner and isinstance(content[outer], dict):
            content[outer][inner] = value
        else:
            content[outer] = value
    path = written(tmp_path, yaml.safe_dump(content))
    if not refusal_of(lambda: read_camera(path), CalibrationError):
        camera = read_camera(path)
        assert np.isfinite(camera.k).all()
        assert np.isfinite(camera.d).all()
        assert min(camera.shape) > 0


cells = st.one_of(
    st.floats().map(repr),
    st.integers(0, 9).map(str),
    st.sampled_from(["", "P1", "1e999", "nan", '"', "\x00", "a" * 140_000, "１"]),
)
HEADS = {
    "motion": "t,cylinder_angle,guide_z",
    "markers": "marker,theta_rad,z_m",
    "tensile": "strain,stress_mpa",
    "lengths": "case,marker,s_fem_m",
}


@pytest.mark.parametrize("reader", HEADS)
@fuzzed
@given(rows=st.lists(st.lists(cells, max_size=5), max_size=6))
@example(rows=[["0", "0", "0"], ["nan", "0", "0"]])
@example(rows=[["0", "nan", "0"]])
@example(rows=[["0", "inf", "0"]])
@example(rows=[['"' + "a" * 140_000]])
def test_any_table(reader: str, rows: list[list[str]], tmp_path: Path) -> None:
    read, errors = READERS[reader]
    path = written(tmp_path, "\n".join([HEADS[reader], *map(",".join, rows)]))
    if refusal_of(lambda: read(path), *errors):
        return
    found = read(path)
    numbers = found.values() if isinstance(found, dict) else vars(found).values()
    assert all(np.isfinite(np.asarray(value, dtype=float)).all() for value in numbers)


@fuzzed
@given(
    rows=st.lists(st.lists(cells, max_size=3), max_size=4), head=st.sampled_from(["file,t", "x"])
)
@example(rows=[['"'], ['"', "0.0"]], head="file,t")
def test_any_list_of_frames(rows: list[list[str]], head: str, tmp_path: Path) -> None:
    (tmp_path / "frames.csv").write_text("\n".join([head, *map(",".join, rows)]), "utf-8")
    refusal_of(lambda: list(FrameSource(tmp_path)), RecordingError)


@fuzzed
@given(
    content=st.one_of(
        st.binary(max_size=80), st.binary(max_size=40).map(lambda b: b"PK\x03\x04" + b)
    ),
    shape=st.lists(st.integers(-1, 10**18), max_size=2),
    kind=st.sampled_from(["<f8", "|O", "[('t', '<f8')]", "(" * 300]),
    headed=st.booleans(),
)
def test_any_replayed_inputs(
    content: bytes, shape: list[int], kind: str, headed: bool, tmp_path: Path
) -> None:
    header = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {tuple(shape)}, }}\n".encode()
    start = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header if headed else b""
    path = written(tmp_path, start + content)
    refusal_of(lambda: RunInputs.read(path), RunInputsError)
