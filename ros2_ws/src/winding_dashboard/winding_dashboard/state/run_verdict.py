"""How a run came out, as the orchestrator reports it and `run.json` keeps it.

The page judges no run: it prints this record, and this is the only module that knows its names.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from winding_core.status import OUTCOME_COMPONENT

# Component of the orchestrator that reports the run that is over, and its key in `run.json`.
STATUS = f"orchestrator: {OUTCOME_COMPONENT}"
_KEY = "outcome"
# Only what was asked for, done and judged is green; what is not listed has no colour.
_STYLES = {"good": "good", "not good": "not-good", "failed": "not-good"}


@dataclass(frozen=True, kw_only=True)
class RunVerdict:
    """The record of one run as it is printed."""

    word: str  # The run in a word or two
    sentence: str  # Who ended it, how far it came, what was lost and judged
    style: str = ""  # `good`, `not-good`, or empty for a run that is neither

    @classmethod
    def from_values(cls, values: Mapping[str, str]) -> Self | None:
        """Return the verdict that diagnostics carry; None where they carry none."""
        if "verdict" not in values:
            return None
        return cls._of(values["verdict"], values.get("sentences", "").splitlines())

    @classmethod
    def from_record(cls, content: Mapping[str, Any]) -> Self:
        """Return the verdict of a run's numbers; that of an older file is never green.

        Raises:
            KeyError: They are none.
        """
        if _KEY in content:
            return cls._of(content[_KEY]["verdict"], content[_KEY]["sentences"])
        if content["ended"]:
            return cls(word="ended early", sentence=str(content["ended"]))
        lay = content.get("verdict")
        sentences = [lay["sentence"]] if lay is not None else []
        return cls(word="", sentence="; ".join([*sentences, content["error_verdict"]["sentence"]]))

    @classmethod
    def _of(cls, word: str, sentences: list[str]) -> Self:
        return cls(word=str(word), sentence="; ".join(sentences), style=_STYLES.get(word, ""))
