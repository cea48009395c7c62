"""What commands write as JSON, held against the published schemas."""

import json
import re
from collections.abc import Callable
from copy import deepcopy
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from in_process import winding
from jsonschema import Draft202012Validator

PAGE = Path(__file__).parents[2] / "docs" / "schemas.md"
SCHEMAS = {
    Path(file.name).stem: json.loads(file.read_text(encoding="utf-8"))
    for package in ("winding_cli", "winding_reports", "winding_study")
    for file in (files(package) / "schemas").iterdir()
}
TENSILE = "strain,stress_mpa\n0.02,0.052\n0.05,0.128\n0.1,0.25\n0.15,0.37\n0.2,0.48\n0.3,0.69\n"


def validated(name: str, path: Path) -> Any:
    """Return a file that keeps its schema; fail with every place where it does not."""
    content = json.loads(path.read_text(encoding="utf-8"), parse_constant=pytest.fail)
    found = Draft202012Validator(SCHEMAS[name]).iter_errors(content)
    assert [f"{error.json_path}: {error.message}" for error in found] == []
    return content


@pytest.mark.parametrize("name", sorted(SCHEMAS))
def test_schema_is_one_and_is_published(name: str) -> None:
    schema = SCHEMAS[name]
    Draft202012Validator.check_schema(schema)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert re.fullmatch(f"urn:cable-winding-twin:{name}:[1-9]", schema["$id"])
    assert f"schemas/{name}.json)" in PAGE.read_text(encoding="utf-8")


PREDICT = ("predict", "--case", 4, "--duration-s", 8)
OUTPUTS = [
    ("predict", PREDICT),
    ("predict", ("predict", "--case", 4, "--duration-s", 8, "--richardson")),
    ("plan", ("plan", "--case", 4, "--pitch-mm", 18, "--turns", 2, "--markers-every-turn")),
    ("plan", ("plan", "--case", 4, "--drum-width-mm", 30, "--flange-mm", 10, "--layers", 2)),
    ("identify", ("identify", "--tensile", "tensile.csv")),
    ("verify", ("verify", "B01")),
    ("study", ("study", "--cases", 4, "--fem", "published")),
    ("calibration", ("study", "--calibrate-rig")),
    pytest.param("study", ("study", "--processes", 1), marks=pytest.mark.campaign),
    pytest.param(
        "closed_loop",
        ("study", "--closed-loop", "--cases", 4, "--draws", 1),
        marks=pytest.mark.campaign,
    ),
]


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Run a command once, in this process, and return the file that it writes."""

    @cache
    def run(*words: object) -> Path:
        folder = tmp_path_factory.mktemp("output")
        (folder / "tensile.csv").write_text(TENSILE, encoding="utf-8")
        winding(folder, *words, "--json", "out.json", code=0)
        return folder / "out.json"

    return run


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "words"),
    OUTPUTS,
    ids=lambda value: value if isinstance(value, str) else " ".join(map(str, value)),
)
def test_output_keeps_its_schema(name: str, words: tuple[object, ...], written: Any) -> None:
    assert validated(name, written(*words))


@pytest.mark.processes
@pytest.mark.slow
def test_faults_keep_their_schema(tmp_path: Path, command: Callable[..., Any]) -> None:
    words = ("faults", "--only", "kill -9 correction", "--json", "out.json")
    done = command(*words, cwd=tmp_path)
    # Exit code 1: a busy computer survived a row too late.
    assert done.returncode in (0, 1), done.stdout + done.stderr
    assert validated("faults", tmp_path / "out.json")


@pytest.mark.processes
@pytest.mark.slow
def test_run_and_recording_keep_schemas(recorded_run: Any, tmp_path: Path, command: Any) -> None:
    live = validated("run", recorded_run.json)
    identity = live["identity"]
    assert identity["date"].endswith("Z")
    assert identity["versions"]["numpy"]
    assert len(identity["weights_sha256"]) == 64
    assert identity["bags"] == [str(recorded_run.bag)]
    bag = recorded_run.bag
    for words in (
        ("bag", "report", bag, "--output", "report"),
        ("track", bag, "--case", 4, "--output", "markers.csv", "--json", "track.json"),
        ("identify", bag, "--case", 4, "--json", "identify.json"),
        ("identify", bag, "--case", 4, "--rig", "--json", "rig.json"),
    ):
        done = command(*words, cwd=tmp_path)
        # Exit code 1: five seconds of a run may not tell a material.
        assert done.returncode in (0, 1), done.stdout + done.stderr
    later = validated("run", tmp_path / "report" / "run.json")
    assert later | {"wall_s": None} == live | {"wall_s": None}
    validated("track", tmp_path / "track.json")
    validated("identify", tmp_path / "identify.json")
    validated("identify", tmp_path / "rig.json")


@pytest.mark.slow
def test_schema_refuses_what_it_does_not_describe(written: Callable[..., Path]) -> None:
    good = validated("predict", written(*PREDICT))
    check = Draft202012Validator(SCHEMAS["predict"])
    without, further, text = deepcopy(good), deepcopy(good), deepcopy(good)
    del without["markers"][0]["theta_rad"]
    further["markers"][0]["theta_deg"] = 1.0
    text["stretch"] = "1.1"
    for content in (without, further, text):
        assert not check.is_valid(content)
