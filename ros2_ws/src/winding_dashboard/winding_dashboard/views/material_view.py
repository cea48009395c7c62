"""What the tracked markers tell of the cable's material, as a sentence."""

from __future__ import annotations

from dataclasses import dataclass

_MEGA = 1.0e6


@dataclass(frozen=True, kw_only=True)
class MaterialView:
    """An identified material.

    Attributes:
        law: Material law that was fitted.
        young: Effective Young's modulus [Pa]; nan where there is none.
        half_width_90: The modulus lies within this nine times in ten [Pa].
        markers: Numbers of the markers used.
        taken_up: Whether the model goes on with it.
        refusal: Why it must not be used; empty where it may be.
    """

    law: str
    young: float
    half_width_90: float
    markers: tuple[int, ...]
    taken_up: bool
    refusal: str = ""


def material_sentence(material: MaterialView | None) -> str:
    """Return what an operator reads of a material."""
    if material is None:
        return "Effective modulus: no marker is measured yet"
    if material.refusal:
        return f"Effective modulus: {material.refusal}"
    markers = ", ".join(f"P{number}" for number in material.markers)
    return (
        f"Effective modulus {material.young / _MEGA:.3f} ± "
        f"{material.half_width_90 / _MEGA:.3f} MPa (nine times in ten), "
        f"{material.law.replace('_', ' ')}, from {markers}; "
        f"the model {'goes on with it' if material.taken_up else 'keeps its own'}"
    )
