"""The machine's figures: speeds, what the sensors measure, and how far it has come."""

from __future__ import annotations

import math

from winding_core.cable.material_report import MaterialReport
from winding_core.machine.readings import Quantity
from winding_dashboard.page.cell import DASH, Cell, millimetres, number
from winding_dashboard.state.view_state import ViewState

_MEGA = 1.0e6
# Votes that are shown; the others are below.
_SHOWN_VOTES = 3
# The clock of a simulated machine ends with its run, at full speed: nothing turns any more.
_OVER, _STANDS = ("finished", "emergency stop"), "stands; the machine's clock has ended"


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


def figures(state: ViewState) -> list[Cell]:
    """Return the newest readings."""
    axes, wanted = state.axes, state.setpoints
    over = state.phase in _OVER and state.clock_stands

    def speed(name: str) -> tuple[float, float]:
        measured = 0.0 if over else getattr(axes, name, math.nan)
        return measured, getattr(wanted, name, math.nan)

    turning, set_turning = speed("angular_speed")
    feed, set_feed = speed("feed_speed")
    angle = axes.cylinder_angle if axes is not None else math.nan
    carriage = axes.carriage_position if axes is not None else math.nan
    best = next(iter(state.votes), None)
    return [
        Cell(
            name="Cylinder, rad/s",
            word=number(turning, 3),
            remark=_STANDS if over else f"set {number(set_turning, 3)}",
        ),
        Cell(
            name="Carriage, mm/s",
            word=millimetres(feed, 2),
            remark=_STANDS if over else f"set {millimetres(set_feed, 2)}",
        ),
        *(_measured(state, quantity) for quantity in state.measured),
        Cell(
            name="Wound, turns", word=number(angle / math.tau, 2), remark=f"{number(angle, 2)} rad"
        ),
        Cell(name="Carriage at, mm", word=millimetres(carriage, 1), remark="guide"),
        Cell(name="Resembles case", word=DASH if best is None else str(best), remark=_votes(state)),
    ]


def _measured(state: ViewState, quantity: Quantity) -> Cell:
    old = state.old(quantity.name)
    source = quantity.sensor.replace("_", " ")
    return Cell(
        name=f"{quantity.name.capitalize()}, {quantity.unit}",
        word=number(state.measured[quantity], quantity.digits),
        remark=f"{source}, {old:.0f} s of machine time old" if old else source,
        style="old" if old else "",
    )


def _votes(state: ViewState) -> str:
    if not state.votes:
        return "nothing measured"
    shown = list(state.votes.items())[:_SHOWN_VOTES]
    return ", ".join(
        f"{share:.0%}" if index == 0 else f"{case}: {share:.0%}"
        for index, (case, share) in enumerate(shown)
    )
