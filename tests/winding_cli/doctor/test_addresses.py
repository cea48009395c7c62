"""Addresses that a publisher fills in: one place, one finding."""

import tomllib
from email.message import Message
from pathlib import Path

import pytest

from winding_cli.doctor.finding import Level
from winding_cli.doctor.installation import DISTRIBUTION, STAND_IN, installed, judge_addresses

ROOT = Path(__file__).parents[3]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def stated(email: str | None, **sites: str) -> Message:
    """Return a distribution's metadata with these addresses."""
    facts = Message()
    if email is not None:
        facts["Maintainer-email"] = email
    for label, address in sites.items():
        facts["Project-URL"] = f"{label}, {address}"
    return facts


TWIN = {"Repository": "https://forge.org/twin"}


@pytest.mark.parametrize(
    ("email", "sites", "level", "found"),
    [
        (
            f"A <a@b{STAND_IN}>",
            TWIN | {"Issues": f"https://forge{STAND_IN}/issues"},
            Level.WARN,
            "to be filled in: maintainer, Issues",
        ),
        (None, TWIN, Level.WARN, "to be filled in: maintainer"),
        ("A <a@b.org>", TWIN, Level.OK, "maintainer, Repository"),
    ],
)
def test_addresses_that_are_to_be_filled_in_are_named(
    email: str | None, sites: dict[str, str], level: Level, found: str
) -> None:
    judged = judge_addresses(stated(email, **sites))
    assert (judged.level, judged.found) == (level, found)
    assert ("pyproject.toml" in judged.advice) is (level is Level.WARN)


def test_a_workspace_names_its_maintainer_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("winding_cli.doctor.installation.DISTRIBUTION", "not-installed-at-all")
    assert installed() is None
    assert judge_addresses(None).level is Level.OK


def test_the_finding_reads_what_the_project_states() -> None:
    assert PROJECT["name"] == DISTRIBUTION
    assert set(PROJECT["urls"]) == {"Repository", "Issues", "Security", "Documentation"}
    facts = installed()
    assert facts is not None
    assert facts["Name"] == DISTRIBUTION


def test_what_stands_in_stands_in_one_place_only() -> None:
    """Manifests are written from it; no page repeats it."""
    pages = [*ROOT.glob("*.md"), *ROOT.glob("*.cff"), *(ROOT / "docs").rglob("*.md")]
    assert len(pages) > 30
    repeated = [page.name for page in pages if "cable-winding-twin.example" in page.read_text()]
    assert repeated == []
    (maintainer,) = PROJECT["maintainers"]
    manifests = sorted((ROOT / "ros2_ws" / "src").glob("*/package.xml"))
    assert manifests
    for manifest in manifests:
        line = f'<maintainer email="{maintainer["email"]}">{maintainer["name"]}</maintainer>'
        assert line in manifest.read_text(encoding="utf-8")
