"""What a forge reads of the tree: the citation, the forms and the workflows."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[2]
FORMS = sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"))
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
RULES = (ROOT / "Makefile").read_text(encoding="utf-8")


def workflow(path: Path) -> dict[str, Any]:
    """Return a workflow; YAML reads its key `on` as true."""
    read = yaml.safe_load(path.read_text(encoding="utf-8"))
    return {"on" if key is True else key: value for key, value in read.items()}


def test_the_citation_has_the_keys_that_its_format_requires_and_the_package_s_facts() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert citation["cff-version"] == "1.2.0"
    assert citation["message"]
    assert citation["title"] == project["name"]
    for key in ("version", "license", "authors", "keywords"):
        assert citation[key] == project[key], key
    assert citation["abstract"] == project["description"]


def test_there_is_a_form_for_an_issue() -> None:
    assert FORMS


@pytest.mark.parametrize("path", FORMS, ids=lambda path: path.stem)
def test_a_form_has_what_a_forge_requires(path: Path) -> None:
    form = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert form["name"]
    assert form["description"]
    fields = [field for field in form["body"] if field["type"] != "markdown"]
    assert all(field["attributes"]["label"] for field in fields)
    assert len({field["id"] for field in fields}) == len(fields) > 0


def test_the_pull_request_form_names_targets_that_make_has() -> None:
    form = (ROOT / ".github" / "pull_request_template.md").read_text(encoding="utf-8")
    targets = re.findall(r"`make ([\w-]+)`", form)
    assert targets
    assert all(re.search(rf"^{target}:", RULES, re.MULTILINE) for target in targets)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("schema", "paths"),
    [("vendor.github-workflows", WORKFLOWS), ("vendor.github-issue-forms", FORMS)],
    ids=["workflows", "forms"],
)
def test_the_forge_s_own_schema_accepts_it(schema: str, paths: list[Path]) -> None:
    assert paths
    words = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", schema, *paths]
    checked = subprocess.run(words, capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_may_do_no_more_than_it_needs(path: Path) -> None:
    read = workflow(path)
    # A job declares what it may write.
    assert read["permissions"] == {"contents": "read"}
    for job in read["jobs"].values():
        assert job["timeout-minutes"] <= 240
        for step in job["steps"]:
            if "uses" in step:
                assert re.fullmatch(r"[\w./-]+@(v\d+|release/v\d+)", step["uses"]), step["uses"]
            if step.get("uses", "").startswith("actions/checkout@"):
                assert step["with"]["persist-credentials"] is False
            # Names that others choose are data of a script, never part of it.
            assert "${{ github." not in step.get("run", "")


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_workflows_run_targets_that_make_has(path: Path) -> None:
    steps = [step for job in workflow(path)["jobs"].values() for step in job["steps"]]
    targets = re.findall(r"\bmake ([\w-]+)", " ".join(step.get("run", "") for step in steps))
    assert targets
    missing = [one for one in targets if not re.search(rf"^{one}:", RULES, re.MULTILINE)]
    assert missing == []


def test_the_tests_run_on_every_python_that_the_package_admits() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    first, beyond = re.fullmatch(r">=3\.(\d+),<3\.(\d+)", project["requires-python"]).groups()
    tested = workflow(ROOT / ".github" / "workflows" / "ci.yml")["jobs"]["test"]
    assert tested["strategy"]["matrix"]["python"] == [
        f"3.{minor}" for minor in range(int(first), int(beyond))
    ]


def test_every_line_is_counted_by_a_scheduled_job() -> None:
    read = workflow(ROOT / ".github" / "workflows" / "ci.yml")
    assert read["on"]["schedule"]
    job = read["jobs"]["coverage"]
    assert "github.event_name == 'schedule'" in job["if"]
    assert any(step.get("run", "").startswith("make coverage") for step in job["steps"])


def test_the_runner_s_script_calls_targets_that_make_has() -> None:
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    targets = re.findall(r"^ *make ([\w-]+)", script, re.MULTILINE)
    assert targets[:3] == ["lint", "docs", "test"]
    assert all(re.search(rf"^{target}:", RULES, re.MULTILINE) for target in targets)


def test_a_machine_without_a_further_python_is_warned_and_passes(tmp_path: Path) -> None:
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    # From where the suite on the first Python has ended.
    ending = script.split("\nmake test\n")[1]
    called = tmp_path / "bin"
    called.mkdir()
    (called / "make").write_text('#!/bin/sh\necho "$@"\n', encoding="utf-8")
    (called / "make").chmod(0o755)
    words = ["/bin/bash", "-euo", "pipefail", "-c", ending]
    variables = {"PATH": str(called), "PYENV_ROOT": str(tmp_path)}
    alone = subprocess.run(words, env=variables, capture_output=True, text=True, check=False)
    assert (alone.returncode, alone.stdout) == (0, "")
    assert "no Python 3.12 was found" in alone.stderr
    # One that reports 3.12, and one that a shim does not lead to.
    home = tmp_path / "versions" / "3.12.9" / "bin"
    home.mkdir(parents=True)
    for folder, name, code in ((called, "python3.12", 127), (home, "python", 0)):
        (folder / name).write_text(f"#!/bin/sh\nexit {code}\n", encoding="utf-8")
        (folder / name).chmod(0o755)
    found = subprocess.run(words, env=variables, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stderr
    assert found.stdout == f"leg PYTHON={home / 'python'} VENV=.venv-3.12\n"
