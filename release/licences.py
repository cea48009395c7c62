"""Write docs/licences.md: the licence of every library that the project or an extra installs.

    python release/licences.py            write the page
    python release/licences.py --check    say whether it is out of date, exit code 1

Licences are read from the metadata of what is installed, so it wants an environment with every
extra that users have (`make install`).
"""

import re
import sys
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "licences.md"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
# Extras of users; tools that test, build and document are not distributed.
EXTRAS = ("ros", "dashboard", "tables", "train", "opcua", "arm", "cluster")
COPYLEFT = re.compile(r"\b[AL]?GPL|General Public|Mozilla|\bMPL|\bEPL|\bCDDL", re.IGNORECASE)
# A licence text in place of its name is known by its first words.
_TEXTS = {"MIT License": "MIT", "Apache License": "Apache-2.0", "BSD 3-Clause": "BSD-3-Clause"}
_UNSAID = "not stated"


@dataclass(frozen=True, kw_only=True)
class Library:
    """One installed library.

    Attributes:
        name: As it calls itself.
        licence: As its metadata states it.
        direct: Whether the project names it itself.
        part: Extra that brings it; empty for what every installation has.
    """

    name: str
    licence: str
    direct: bool
    part: str


def licence_of(distribution: metadata.Distribution) -> str:
    """Return the licence that a distribution states, or that none is stated.

    Args:
        distribution: Its metadata are asked first, then the ROS manifest that it may hold, then
            the first words of its licence file.
    """
    facts = distribution.metadata
    expression = "; ".join(facts.get_all("License-Expression") or ())
    if expression:
        return expression
    classes = [
        line.rpartition(" :: ")[2]
        for line in facts.get_all("Classifier") or ()
        if line.startswith("License ::") and line != "License :: OSI Approved"
    ]
    text = "\n".join(facts.get_all("License") or ()).strip()
    # Some put the whole text there.
    if text and "\n" not in text and len(text) < 80 and text.upper() != "UNKNOWN":
        return text
    if classes:
        return "; ".join(classes)
    files = distribution.files or ()
    manifests = [file.read_text() for file in files if file.name == "package.xml"]
    stated = [one for xml in manifests for one in re.findall(r"<license[^>]*>([^<]+)<", xml)]
    if stated:
        return "; ".join(dict.fromkeys(stated))
    texts = [file.read_text() for file in files if file.name.startswith("LICENSE")]
    return next(
        (name for body in (text, *texts) for start, name in _TEXTS.items() if start in body[:200]),
        _UNSAID,
    )


def required(texts: Iterable[str], extras: Iterable[str] = ("",)) -> dict[str, set[str]]:
    """Return the extras wanted of each library that requirements name on this machine.

    Args:
        texts: Requirements.
        extras: Extras that are asked for of what states them.
    """
    wanted: dict[str, set[str]] = {}
    for requirement in map(Requirement, texts):
        marker = requirement.marker
        if marker is None or any(marker.evaluate({"extra": extra}) for extra in ("", *extras)):
            name = canonicalize_name(requirement.name)
            wanted.setdefault(name, set()).update(requirement.extras)
    return wanted


def libraries() -> list[Library]:
    """Return every library of the project and its extras, direct ones first in each part."""
    found: dict[str, Library] = {}
    optional = PROJECT["optional-dependencies"]
    for part, texts in [("", PROJECT["dependencies"]), *((one, optional[one]) for one in EXTRAS)]:
        named = required(texts)
        waiting = list(named.items())
        while waiting:
            name, extras = waiting.pop(0)
            distribution = metadata.distribution(name)
            if name not in found:
                found[name] = Library(
                    name=distribution.metadata["Name"],
                    licence=licence_of(distribution),
                    direct=name in named,
                    part=part,
                )
            elif not extras:
                continue
            further = required(distribution.requires or (), extras)
            waiting += [item for item in further.items() if item[0] not in found]
    return sorted(found.values(), key=lambda one: (not one.direct, one.name.lower()))


def _rows(some: Iterable[Library]) -> list[str]:
    return [
        f"| {one.name} | {one.licence} | {f'`{one.part}`' if one.part else 'always'} |"
        for one in some
    ]


def page(all_of_them: list[Library]) -> str:
    """Return the page.

    Args:
        all_of_them: As `libraries` returns them.
    """
    head = ["| library | licence | extra |", "|---|---|---|"]
    direct = [one for one in all_of_them if one.direct]
    further = [one for one in all_of_them if not one.direct]
    weak = [one for one in all_of_them if COPYLEFT.search(one.licence)]
    unsaid = [one.name for one in all_of_them if one.licence == _UNSAID]
    return "\n".join(
        [
            "# Licences",
            "",
            "The project is under Apache-2.0. These are the licences that the metadata of the",
            "libraries states, with the versions of `constraints.txt` on Linux x86-64 and Python",
            "3.11, or the ROS manifest inside; `release/licences.py` writes this page from an",
            "environment with every extra. The distributions `ros-jazzy-...` are empty: they name",
            "others. A wheel may hold compiled code of others as well, such as FFmpeg (LGPL) in",
            "OpenCV's: see its own licence files. `make sbom` lists a run's environment as",
            "CycloneDX.",
            "",
            "## Copyleft",
            "",
            "None of them is changed or copied into this project; each is imported as published.",
            "",
            *head,
            *_rows(weak),
            "",
            "Without a statement in the metadata: " + (", ".join(unsaid) or "none") + ".",
            "",
            "## Named by the project",
            "",
            *head,
            *_rows(direct),
            "",
            "## Brought by these",
            "",
            *head,
            *_rows(further),
            "",
        ]
    )


def main() -> int:
    """Write or check the page; return the exit code."""
    text = page(libraries())
    if "--check" in sys.argv:
        stale = not PAGE.is_file() or PAGE.read_text(encoding="utf-8") != text
        if stale:
            print(f"{PAGE.relative_to(ROOT)} is out of date: run release/licences.py")
        return int(stale)
    PAGE.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
