"""Write what commands print into the pages, and keep it current.

    python docs/outputs.py            run every command and write its output
    python docs/outputs.py --check    name what is out of date, exit code 1

A page marks an output by a comment with its command, before a code block or, for Markdown, before
a line `<!-- end of output -->`:

    <!-- output of: winding predict --case 4 | sed -n 1,9p -->
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
_OUTPUT = re.compile(
    r"^<!-- output of: (?P<command>.+?) -->\n"
    r"(?:(?P<fence>```\w*\n)(?P<block>.*?)(?=^```$)|\n(?P<text>.*?)(?=\n<!-- end of output -->$))",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True, kw_only=True)
class Output:
    """One output in one file.

    Attributes:
        file: That holds it.
        command: That prints it, of bash.
        shown: What the file holds.
        start: Where in the file's text it begins.
    """

    file: Path
    command: str
    shown: str
    start: int

    def printed(self) -> str:
        """Run the command and return what it prints.

        Raises:
            subprocess.CalledProcessError: It fails.
        """
        here = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
        done = subprocess.run(
            ["bash", "-o", "pipefail", "-c", self.command],
            cwd=ROOT,
            env={**os.environ, "PATH": here, "COLUMNS": "100", "NO_COLOR": "1"},
            capture_output=True,
            text=True,
            check=True,
        )
        lines = [line.rstrip() for line in done.stdout.splitlines()]
        return "\n".join(lines).strip("\n") + "\n"


def outputs() -> Iterator[Output]:
    """Yield every output of every page, last first within a page."""
    for page in PAGES:
        for match in reversed([*_OUTPUT.finditer(page.read_text(encoding="utf-8"))]):
            group = "text" if match["fence"] is None else "block"
            yield Output(
                file=page, command=match["command"], shown=match[group], start=match.start(group)
            )


def main() -> int:
    """Write or check every output; return the exit code."""
    stale = 0
    for output in outputs():
        printed = output.printed()
        if printed == output.shown:
            continue
        stale += 1
        if "--check" in sys.argv:
            print(f"{output.file.relative_to(ROOT)}: `{output.command}` prints something else now")
        else:
            text = output.file.read_text(encoding="utf-8")
            end = output.start + len(output.shown)
            output.file.write_text(text[: output.start] + printed + text[end:], encoding="utf-8")
    return int(stale > 0 and "--check" in sys.argv)


if __name__ == "__main__":
    sys.exit(main())
