"""The machine's figures: speeds, what the sensors measure, and how far it has come."""

from __future__ import annotations

import math
from dataclasses import dataclass

from winding_core.cable.material_report import MaterialReport
from winding_core.machine.readings import Quantity
from winding_dashboard.page.numbers import DASH, PER_METRE, number
from winding_dashboard.state.view_state import ViewState

_MEGA = 1.0e6
# Votes that are shown; the others are below.
_SHOWN_VOTES = 3
# The clock of a simulated machine ends with its run, at full speed: nothing turns any more.
_OVER, _STANDS = ("finished", "emergency stop"), "stands; the machine's clock has ended"
# On the machine's clock an older value is no longer the present one [s].
OLD = 1.0


def material_sentence(material: MaterialReport | None) -> str:
    """Return the identified modulus as a sentence."""
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


@dataclass(frozen=True, kw_only=True)
class Figure:
    """One big number."""

    name: str  # With its unit
    value: str  # As text
    remark: str  # Beneath it
    old: bool = False  # Whether its source has fallen silent while the machine's clock went on


def figures(state: ViewState) -> list[Figure]:
    """Return the newest readings."""
    axes, wanted = state.axes, state.setpoints
    speed, feed = (
        (axes.angular_speed, axes.feed_speed) if axes is not None else (math.nan, math.nan)
    )
    set_speed, set_feed = (
        (wanted.angular_speed, wanted.feed_speed) if wanted is not None else (math.nan, math.nan)
    )
    angle = axes.cylinder_angle if axes is not None else math.nan
    carriage = axes.carriage_position if axes is not None else math.nan
    best = next(iter(state.votes), None)
    over = state.phase in _OVER and state.clock_stands
    if over:
        speed = feed = 0.0
    return [
        Figure(
            name="Cylinder, rad/s",
            value=number(speed, 3),
            remark=_STANDS if over else f"set {number(set_speed, 3)}",
        ),
        Figure(
            name="Carriage, mm/s",
            value=number(feed, 2, PER_METRE),
            remark=_STANDS if over else f"set {number(set_feed, 2, PER_METRE)}",
        ),
        *(_measured(state, quantity) for quantity in state.measured),
        Figure(
            name="Wound, turns",
            value=number(angle / math.tau, 2),
            remark=f"{number(angle, 2)} rad",
        ),
        Figure(name="Carriage at, mm", value=number(carriage, 1, PER_METRE), remark="guide"),
        Figure(
            name="Resembles case", value=DASH if best is None else str(best), remark=_votes(state)
        ),
    ]


def _measured(state: ViewState, quantity: Quantity) -> Figure:
    behind = state.behind(quantity.name)
    old = behind > OLD
    source = quantity.sensor.replace("_", " ")
    return Figure(
        name=f"{quantity.name.capitalize()}, {quantity.unit}",
        value=number(state.measured[quantity], quantity.digits),
        remark=f"{source}, {behind:.0f} s of machine time old" if old else source,
        old=old,
    )


def _votes(state: ViewState) -> str:
    if not state.votes:
        return "nothing measured"
    shown = list(state.votes.items())[:_SHOWN_VOTES]
    return ", ".join(
        f"{share:.0%}" if index == 0 else f"{case}: {share:.0%}"
        for index, (case, share) in enumerate(shown)
    )
