"""Lines of G-code as words: a letter and a number each, without comments."""

from __future__ import annotations

import re
from collections.abc import Iterator

from winding_core.lay.program import LayProgramError

Word = tuple[str, float]

_COMMENT = re.compile(r"\([^()]*\)|;.*")
_WORD = re.compile(r"([A-Z])\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:E[+-]?\d+)?)\s*", re.ASCII)


def words_of(text: str, name: str) -> Iterator[tuple[int, list[Word]]]:
    """Yield the number of every line that says something, and its words.

    Raises:
        LayProgramError: A line is no G-code.
    """
    for number, line in enumerate(text.splitlines(), start=1):
        rest = _COMMENT.sub("", line).strip().upper()
        # A percent sign marks begin and end of a tape; a line behind a slash may be left out.
        if rest == "%":
            continue
        if rest.startswith("/"):
            raise LayProgramError(
                f"line {number} of {name} may be left out (/): write it or leave it out"
            )
        words: list[Word] = []
        at = 0
        while at < len(rest):
            found = _WORD.match(rest, at)
            if found is None:
                raise LayProgramError(
                    f"line {number} of {name} is no G-code from {rest[at : at + 20]!r} on"
                )
            words.append((found[1], float(found[2])))
            at = found.end()
        words = [word for word in words if word[0] != "N"]
        if words:
            yield number, words
