"""What the tracked markers tell of the cable's material, as a sentence."""

from __future__ import annotations

from winding_core.cable.material_report import MaterialReport

_MEGA = 1.0e6


def material_sentence(material: MaterialReport | None) -> str:
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
