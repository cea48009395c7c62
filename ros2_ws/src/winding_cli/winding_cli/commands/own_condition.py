"""A case of the paper, or a condition of one's own: the options that say which."""

from __future__ import annotations


def condition_values(case: int | None, own: dict[str, float | None]) -> dict[str, object]:
    """Return the condition's parameters as the nodes take them.

    Args:
        case: Row of Table 1, or None.
        own: Value [SI] of each parameter of a condition of one's own; None where not given.

    Raises:
        ValueError: Both are given, neither is, or something is missing.
    """
    given = {name: value for name, value in own.items() if value is not None}
    if case is not None and given:
        raise ValueError(
            f"{next(iter(given)).replace('_', ' ')} is given beside --case {case}; leave --case "
            "out for a condition of one's own"
        )
    if case is not None:
        if case < 1:
            raise ValueError(f"case must be one of 1 to 12, got {case}")
        return {"case": case}
    if not given:
        raise ValueError(
            "say what to wind: --case 1 to 12, or --cylinder-diameter-mm, --cable-diameter-mm, "
            "--tension-n and --marker-spacing-mm"
        )
    missing = [name for name in own if name not in given]
    if missing:
        raise ValueError(f"a condition of one's own also needs its {missing[0].replace('_', ' ')}")
    return {"case": 0, **given}
