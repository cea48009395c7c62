"""The condition as an operator types it: the options of the commands, as fields of a form."""

from collections.abc import Mapping
from typing import Any

from winding_core.cable.condition import OWN, Condition
from winding_core.parameters import (
    Declaration,
    Value,
    options,
    refuse_unknown,
    shown_values,
    typed_declaration,
)

# Case and law are chosen from lists; everything else is typed.
FIELDS = {
    key: typed_declaration(key, item)
    for key, item in options(Condition).items()
    if key not in ("case", "law")
}
# These define another cable than the case's: shown without a case only.
OWN_FIELDS = tuple(key for key, item in FIELDS.items() if item.name in OWN)
LAWS = next(item.choices or () for key, item in options(Condition).items() if key == "law")


def label(key: str) -> str:
    """Return what a field of the form is called, with its unit."""
    item = options(Condition)[key]
    symbol = item.unit.symbol if item.unit is not None else ""
    return f"{item.label}, {symbol}" if symbol else item.label


def hint(item: Declaration) -> str:
    """Return what an empty field stands for."""
    return "" if item.default in (0.0, "") else f"{item.default:g}"


def typed_options(form: Mapping[str, Any]) -> dict[str, object]:
    """Return the options of a condition that a filled form gives.

    Args:
        form: `case`, 0 for another cable, `law`, and `fields` by option; None and nothing stand
            for the default there.

    Raises:
        ValueError: There is no such field, or what stands there is no form.
    """
    try:
        case, filled = int(form.get("case") or 0), dict(form.get("fields") or {})
    except TypeError as error:
        raise ValueError(f"this is no form: {error}") from None
    refuse_unknown(filled, FIELDS, owner="the form")
    typed = {
        key: _whole(FIELDS[key], value)
        for key, value in filled.items()
        if value not in (None, "") and not (case and key in OWN_FIELDS)
    }
    return {**({"case": case} if case else {}), "law": str(form.get("law")), **typed}


def form_values(condition: Condition) -> dict[str, Value]:
    """Return what stands in a form for a condition; nothing for what is the default."""
    default = Condition()
    names = [item.name for item in FIELDS.values()]
    return shown_values(
        Condition,
        {
            name: getattr(condition, name)
            for name in names
            if getattr(condition, name) != getattr(default, name)
        },
    )


def brief(name: str, *, weight: float, cylinder_mm: float, cable_mm: float) -> str:
    """Return a condition in few words, the weight [N] first: lists cut what is long."""
    return f"{name}: {weight:.2f} N, cylinder {cylinder_mm:g}, cable {cable_mm:g} mm"


def _whole(item: Declaration, value: object) -> object:
    """Return a browser's number as a whole one where that is declared."""
    if isinstance(item.default, int) and isinstance(value, float) and value.is_integer():
        return int(value)
    return value
