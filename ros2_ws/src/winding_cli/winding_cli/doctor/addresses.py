"""Whom a user of this installation can ask: addresses that its publisher fills in."""

from __future__ import annotations

from importlib import metadata

from winding_cli.doctor.finding import Finding, ok, warn

DISTRIBUTION = "cable-winding-twin"
# A domain that nobody can own (RFC 2606): the value stands in for one.
STAND_IN = ".example"
_CHECK = "addresses of the project"


def judge_addresses(facts: metadata.PackageMetadata | None) -> Finding:
    """Return whether the project's maintainer and its sites have been filled in.

    Args:
        facts: What the installed distribution says of itself; None for a workspace, which colcon
            installs package by package.
    """
    if facts is None:
        return ok(_CHECK, "a workspace; each package.xml names its maintainer")
    sites = [url.partition(", ") for url in facts.get_all("Project-URL") or ()]
    (maintainer,) = facts.get_all("Maintainer-email") or ("",)
    named = {"maintainer": maintainer} | {label: address for label, _, address in sites}
    missing = [label for label, address in named.items() if not address or STAND_IN in address]
    if not missing:
        return ok(_CHECK, ", ".join(named))
    return warn(
        _CHECK,
        f"to be filled in: {', '.join(missing)}",
        "publisher: maintainers and [project.urls] in pyproject.toml; the graph needs none",
    )


def installed() -> metadata.PackageMetadata | None:
    """Return what the installed distribution says of itself; None where there is none."""
    try:
        return metadata.metadata(DISTRIBUTION)
    except metadata.PackageNotFoundError:
        return None
