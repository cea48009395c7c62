"""A run of a folder as a row of its index, and two runs side by side."""

import hashlib
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from winding_core.run_outcome import Verdict

# Verdicts on what is not a run that a `Verdict` judges, and on one that lost data.
UNHEALTHY, UNREADABLE, BROKEN_OFF, TWIN = "unhealthy", "unreadable", "broken off", "twin"
VERDICTS = (*(verdict.value for verdict in Verdict), UNHEALTHY, UNREADABLE, BROKEN_OFF, TWIN)
_LARGEST = 50_000_000  # No run's numbers are larger [bytes]
# Options that may differ between runs of one series: labels, lengths, redundant options.
_NOT_OF_A_SERIES = ("case", "duration_s", "markers", "tension_mpa", "guide_distance_mm")


class RunRow(NamedTuple):
    """A run; None where something is not known. Runs of one series repeat one condition."""

    path: str  # Of its folder, from the indexed one
    run_id: str | None = None
    date: str | None = None  # UTC, ISO 8601
    verdict: str = UNREADABLE  # One of VERDICTS
    good: int = 0  # 1 where it is complete, judged and healthy, and keeps every limit
    healthy: int = 0  # 1 where it came to its end and lost nothing: its numbers may be charted
    reason: str = ""  # Why it is not good
    cable: str | None = None
    machine: str | None = None
    batch: str | None = None
    operator: str | None = None
    remark: str | None = None
    case: int | None = None  # Row of Table 1; 0 for any other condition
    series: str = ""  # Digest of what was wound and how
    error_pct: float | None = None  # Largest error of a corrected length
    error_limit_pct: float | None = None
    length_error_pct: float | None = None  # Mean of measured over predicted length, less 100 %
    young_pa: float | None = None  # Identified, where it may be used
    young_error_pa: float | None = None  # Its standard error
    lay_error_m: float | None = None  # Largest of the judged turns
    lay_tolerance_m: float | None = None
    lay_kept: int | None = None  # 1 where the lay keeps its tolerance
    free_length_m: float | None = None  # Estimated by the controller of the lay
    load_share: float | None = None  # Likewise
    turns: float | None = None
    time_s: float | None = None
    weights: str | None = None  # Of the correction


def row_of_file(path: str, file: Path) -> RunRow:
    """Return the row of a run's `run.json`; one that cannot be read has the reason."""
    try:
        if file.stat().st_size > _LARGEST:
            return RunRow(path=path, reason=f"run.json is larger than {_LARGEST} bytes")
        return run_row(path, _content(file))
    except ValueError as error:
        return RunRow(path=path, reason=f"run.json {error}")
    except OSError as error:
        return RunRow(path=path, reason=f"run.json cannot be read: {error.strerror or error}")


def run_row(path: str, content: object) -> RunRow:
    """Return the row of what a run's `run.json` states, see its schema."""
    verdict = _at(content, "outcome", "verdict")
    if verdict not in list(Verdict):
        return RunRow(path=path, reason="run.json states no outcome of a run")
    condition = _at(content, "identity", "condition")
    labels: dict[str, Any] = {
        name: _text(content, "identity", "labels", name)
        for name in ("cable", "machine", "batch", "operator", "remark")
    }
    case = _at(content, "case")
    case = case if isinstance(case, int) else None
    lay, material = _at(content, "lay"), _at(content, "material")
    usable = isinstance(material, dict) and not material.get("refused")
    lengths = [
        measured / predicted - 1.0
        for marker in _list(content, "markers")
        if (measured := _number(marker, "s_tracked_m"))
        and (predicted := _number(marker, "s_fem_m"))
    ]
    worst = [
        abs(error)
        for turn in _list(lay, "turns")
        if _at(turn, "judged") is True and (error := _number(turn, "error_largest_m")) is not None
    ]
    kept = _at(lay, "kept")
    return RunRow(
        path=path,
        run_id=_text(content, "identity", "run_id"),
        date=_text(content, "identity", "date"),
        **_judged(content),
        **labels | {"cable": labels["cable"] or _cable_name(case, condition)},
        case=case,
        series=_digest(condition),
        error_pct=_number(content, "error_verdict", "largest_error_pct"),
        error_limit_pct=_number(content, "error_verdict", "limit_pct"),
        length_error_pct=100.0 * math.fsum(lengths) / len(lengths) if lengths else None,
        young_pa=_number(material, "young_pa") if usable else None,
        young_error_pa=_number(material, "standard_error_pa") if usable else None,
        lay_error_m=max(worst, default=None),
        lay_tolerance_m=_number(lay, "tolerance_m"),
        lay_kept=int(kept) if isinstance(kept, bool) else None,
        free_length_m=_number(lay, "free_length_m"),
        load_share=_number(lay, "load_share"),
        turns=_number(content, "outcome", "done", "turns"),
        time_s=_number(content, "outcome", "done", "time_s"),
        weights=_text(content, "identity", "weights"),
    )


def _judged(content: object) -> dict[str, Any]:
    """Return verdict, whether it is good and healthy, and why not; doubts are never good."""
    verdict = str(_at(content, "outcome", "verdict"))
    sentences = [str(item) for item in _list(content, "outcome", "sentences")]
    losses = [str(item) for item in _list(content, "outcome", "losses")]
    complete = _at(content, "outcome", "complete") is True
    lengths = _text(content, "error_verdict", "sentence") or "its lengths were not judged"
    lay = _text(content, "verdict", "sentence")
    reason = sentences[0] if sentences else "it does not say how it ended"
    if not complete and verdict not in (Verdict.FAILED, Verdict.INCOMPLETE):
        verdict = Verdict.INCOMPLETE.value
    elif losses and complete and verdict != Verdict.FAILED:
        verdict, reason = UNHEALTHY, losses[0]
    elif verdict == Verdict.GOOD and _at(content, "error_verdict", "good") is not True:
        verdict, reason = Verdict.NOT_JUDGED.value, lengths
    elif verdict in (Verdict.NOT_GOOD, Verdict.NOT_JUDGED):
        wrong = (False,) if verdict == Verdict.NOT_GOOD else (None,)
        of_lay = lay and _at(content, "verdict", "kept") in wrong
        reason = f"lay: {lay}" if of_lay else lengths
    good = verdict == Verdict.GOOD
    return {
        "verdict": verdict,
        "good": int(good),
        "healthy": int(complete and not losses and verdict != Verdict.FAILED),
        "reason": "" if good else reason,
    }


def _cable_name(case: int | None, condition: object) -> str | None:
    if case:
        return f"case {case}"
    diameter = _number(condition, "cable_diameter_mm", "value")
    return None if diameter is None else f"{diameter:g} mm"


def _digest(condition: object) -> str:
    if not isinstance(condition, dict):
        return ""
    conditions = sorted(
        (name, str(_at(item, "value")))
        for name, item in condition.items()
        if name not in _NOT_OF_A_SERIES
    )
    return hashlib.sha256(repr(conditions).encode()).hexdigest()[:12]


def _at(content: object, *keys: str) -> Any:
    for key in keys:
        if not isinstance(content, dict):
            return None
        content = content.get(key)
    return content


def _list(content: object, *keys: str) -> list[Any]:
    found = _at(content, *keys)
    return found if isinstance(found, list) else []


def _text(content: object, *keys: str) -> str | None:
    found = _at(content, *keys)
    return found if isinstance(found, str) and found else None


def _number(content: object, *keys: str) -> float | None:
    found = _at(content, *keys)
    known = isinstance(found, int | float) and not isinstance(found, bool)
    return float(found) if known and math.isfinite(found) else None


_OF_THE_INDEX = ("series", "healthy", "good")  # Fields that describe the file and not the run


def compared(first: Path, second: Path) -> dict[str, Any]:
    """Return two runs side by side as JSON values.

    Every number of the index is there, every marker, and of the condition what differs.

    Raises:
        ValueError: One of them cannot be read.
    """
    files, runs = (first, second), []
    for path in files:
        try:
            runs.append(_content(path))
        except ValueError as error:
            raise ValueError(f"{path} {error}") from error
    both = [run_row(str(path.parent), run) for path, run in zip(files, runs, strict=True)]
    for path, row in zip(files, both, strict=True):
        if row.verdict == UNREADABLE:
            raise ValueError(f"{path}: {row.reason}")
    rows = [
        _row(name, *(getattr(row, name) for row in both))
        for name in RunRow._fields
        if name not in _OF_THE_INDEX
    ]
    return {"runs": [*map(str, files)], "rows": [*rows, *_markers(runs), *_condition(runs)]}


def _content(path: Path) -> Any:
    """Return what a file of JSON holds.

    Raises:
        ValueError: Why it cannot be read, to follow its name.
    """
    try:
        return json.loads(path.read_bytes())
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise ValueError("is no JSON") from error


def _row(name: str, first: Any, second: Any) -> dict[str, Any]:
    numbers = all(
        isinstance(value, int | float) and not isinstance(value, bool) for value in (first, second)
    )
    difference = second - first if numbers and name != "case" else None
    return {"name": name, "first": first, "second": second, "difference": difference}


def _markers(runs: list[Any]) -> Iterator[dict[str, Any]]:
    markers = [{item["id"]: item for item in run.get("markers", [])} for run in runs]
    for number in sorted(markers[0].keys() | markers[1].keys()):
        for key in ("s_fem_m", "s_tracked_m", "s_corrected_m"):
            values = (marker.get(number, {}).get(key) for marker in markers)
            yield _row(f"P{number} {key}", *values)


def _condition(runs: list[Any]) -> Iterator[dict[str, Any]]:
    conditions = [run["identity"].get("condition", {}) for run in runs]
    for name in sorted(conditions[0].keys() | conditions[1].keys()):
        values = [condition.get(name, {}).get("value") for condition in conditions]
        if values[0] != values[1]:
            yield _row(name, *values)
