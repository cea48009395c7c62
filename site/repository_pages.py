"""Pages of the site that are not in docs/: the repository's own, its files, and the Python API.

A hook of MkDocs. Links that leave docs/ lead to pages and files of the site, so that a copy of it
is whole without a network.
"""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]
# Page of the repository -> page of the site.
PAGES = {
    "README.md": "index.md",
    "CHANGELOG.md": "CHANGELOG.md",
    "CONTRIBUTING.md": "CONTRIBUTING.md",
    "SECURITY.md": "SECURITY.md",
    "QUALITY_DECLARATION.md": "QUALITY_DECLARATION.md",
}
# Modules with a page of reference, by package: the public one, and what its results are made of.
MODULES = {
    "cable_winding": ("prediction", "motion", "tracking", "material", "correction", "recording"),
    "winding_core": (
        "cable.condition", "cable.cases", "cable.material_law", "cable.prony", "machine.drive",
        "machine.tension", "machine.readings", "lay.limits", "lay.program", "lay.records",
        "markers", "run_inputs",
    ),
    "cable_fem_node": (
        "winding.prediction", "winding.winding_config", "winding.rod_winding", "identification",
    ),
    "marker_tracker_node": ("",),
    "winding_rig_node": ("camera", "lay.lay_law", "lay.lay_on", "lay.driven_lay"),
    "correction_node": ("models.weights", "models.factor_models"),
    "lay_control_node": (
        "programs", "planning.planner", "control.control_parameters",
        "control.lay_controller", "control.expected_landing",
    ),
    "winding_recorder": ("bags.tables", "bags.check"),
}  # fmt: skip
# A line that is nothing but a link to a program of examples/: the site shows the program itself.
_PROGRAM = re.compile(r"^\[[^\]]+\]\((\.\./(?:\.\./)*(examples/\S+\.py))\)$", re.MULTILINE)
_LINK = re.compile(r"(\]\()([^)\s#]+)((?:#[^)\s]*)?\))")
# The theme's search, as it begins.
_SEARCH = '<div class="md-search" data-md-component="search" role="dialog"'
# Named as `extra_css` and as a polyfill in mkdocs.yml.
ASSETS = ("site.css", "iframe-worker.js")
# Weight of a page's hits in the search, by the beginning of its path: tasks before records.
BOOSTS = {
    "tutorials/": 2.0,
    "gallery": 2.0,
    "commands": 2.0,
    "dashboard": 2.0,
    "troubleshooting": 1.5,
    "measurements/": 0.1,
    "decisions/": 0.1,
    "reference/cable_winding": 0.5,
    "reference/": 0.05,
    "CHANGELOG": 0.05,
    "licences": 0.05,
    "QUALITY_DECLARATION": 0.05,
}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the repository's pages, the Python reference, and files that pages link to."""
    for asset in ASSETS:
        content = Path(__file__).with_name(asset).read_text("utf-8")
        files.append(File.generated(config, asset, content=content))
    linked: set[str] = set()
    for file in files.documentation_pages():
        linked |= _outside(file.src_uri, Path(config.docs_dir, file.src_uri).read_text("utf-8"))
    for source, target in PAGES.items():
        text = (ROOT / source).read_text("utf-8")
        linked |= _outside(f"../{source}", text)
        files.append(File.generated(config, target, content=_LINK.sub(_from_root, text)))
    for path in sorted(linked):
        if path not in PAGES:
            files.append(File.generated(config, f"files/{path}", abs_src_path=str(ROOT / path)))
    for package, modules in MODULES.items():
        content = f"# {package}\n\n" + "".join(
            f"## `{_dotted(package, module)}`\n\n::: {_dotted(package, module)}\n"
            "    options: {heading_level: 3}\n\n"
            for module in modules
        )
        files.append(File.generated(config, f"reference/{package}.md", content=content))
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Show linked programs, turn links to files into those of the site, and weigh the page."""
    del config, files
    boosts = (boost for start, boost in BOOSTS.items() if page.file.src_uri.startswith(start))
    page.meta["search"] = {"boost": next(boosts, 1.0)}
    markdown, programs = _PROGRAM.subn(_program, markdown)
    if programs:
        # Lines of 100 characters need the room.
        page.meta.setdefault("hide", ["navigation"])
    place = PurePosixPath("docs", page.file.src_uri).parent
    up = "../" * (len(place.parts) - 1)

    def turned(match: re.Match[str]) -> str:
        path = _within(place, match[2])
        if path is None or path.startswith("docs"):
            return match[0]
        return f"{match[1]}{up}{PAGES.get(path, f'files/{path}')}{match[3]}"

    return _LINK.sub(turned, markdown)


def on_post_page(output: str, *, page: Page, config: MkDocsConfig) -> str:
    """Name the search for screen readers, which the theme does not."""
    del page, config
    return output.replace(_SEARCH, f'{_SEARCH} aria-label="Search"')


def _dotted(package: str, module: str) -> str:
    return f"{package}.{module}" if module else package


def _program(match: re.Match[str]) -> str:
    text = (ROOT / match[2]).read_text("utf-8")
    return f'```python title="{match[2]}"\n{text}```\n\n[Download]({match[1]})'


def _from_root(match: re.Match[str]) -> str:
    """Return a link of a page of the repository as one of a page beside those of docs/."""
    target = match[2]
    if re.match(r"[a-z]+:", target):
        return match[0]
    turned = target.removeprefix("docs/") if target.startswith("docs/") else f"../{target}"
    return f"{match[1]}{turned}{match[3]}"


def _outside(page: str, text: str) -> set[str]:
    """Return the files of the repository outside docs/ that a page of docs/ links to."""
    place = PurePosixPath("docs", page).parent
    paths = (_within(place, match[2]) for match in _LINK.finditer(text))
    return {
        path
        for path in paths
        if path is not None and not path.startswith("docs") and (ROOT / path).is_file()
    }


def _within(place: PurePosixPath, target: str) -> str | None:
    """Return the path from the root of a link's target; None for a link to elsewhere."""
    if re.match(r"[a-z]+:", target):
        return None
    parts: list[str] = []
    for part in (place / target).parts:
        if part == "..":
            if not parts:
                return None
            parts.pop()
        else:
            parts.append(part)
    return "/".join(parts)
