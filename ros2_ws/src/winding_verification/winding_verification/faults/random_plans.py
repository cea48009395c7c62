"""Runs with faults that a seed draws: any node, driver, disk, message, signal, at any moment."""

from __future__ import annotations

import random

from winding_verification.faults.trial import Fault, Plan

_NODES = ("winding_rig", "cable_fem", "marker_tracker", "correction")
_FOREIGN_NODES = ("cable_fem", "correction")
_INJECTED = (
    *("load_cell:off", "load_cell:garbage", "cylinder_encoder:stuck", "cylinder_encoder:wrong:-1"),
    *("rig/tension:garbage", "rig/joint_states:garbage", "rig/joint_states:wrong:10"),
    *("camera:off", "camera:intermittent:0.2", "/clock:wrong:2"),
)
_MACHINE = (
    *("stops unanswered", "stops refused", "stops ignored", "stops early", "jumps"),
    *("goes back in time", "shifts its clock", "sends NaN"),
)
_SIGNALS = ("INT", "TERM", "INT INT", "TERM TERM", "INT TERM")
# Of the faults so many come while the nodes are started.
_EARLY, _START_TAKES = 0.15, 8.0


def draw_plans(count: int, seed: int) -> list[Plan]:
    """Return so many runs, with 0 to 3 faults each; equal seeds draw equal runs."""
    draw = random.Random(seed)
    return [_plan(draw, f"{seed}.{number}") for number in range(1, count + 1)]


def _plan(draw: random.Random, name: str) -> Plan:
    foreign = draw.random() < 0.5
    duration = round(draw.uniform(2.0, 4.0), 1)
    faults = [_fault(draw, foreign, duration) for _ in range(draw.randrange(4))]
    # Faults of the start come first: those of the run wait for a motion.
    faults.sort(key=lambda fault: (fault.at >= 0.0, abs(fault.at)))
    return Plan(name=name, faults=tuple(faults), foreign=foreign, duration=duration)


def _fault(draw: random.Random, foreign: bool, duration: float) -> Fault:
    if draw.random() < _EARLY:
        at = -draw.uniform(0.1, _START_TAKES)
    else:
        at = draw.uniform(0.05, duration)
    node = draw.choice(_FOREIGN_NODES if foreign else _NODES)
    own = f"machine {draw.choice(_MACHINE)}"
    if not foreign:
        # Its parameters are there when its node is.
        own = f"role set winding_rig inject_fault {draw.choice(_INJECTED)}"
    kinds = (
        (f"kill {node}", 3),
        # A node that is held while it starts is waited for two minutes.
        (f"hold {node}", 2 if at >= 0.0 else 0),
        (f"hold {node} {draw.uniform(0.1, 2.0):.2f}", 1),
        (f"hold orchestrator {draw.uniform(0.1, 2.5):.2f}", 1),
        (own, 5 if foreign or at >= 0.0 else 0),
        (f"{draw.choice(('kill', 'hold'))} driver", 2 if foreign else 0),
        ("disk", 1),
        ("remove", 1),
        (f"role rogue {draw.choice(('', 'stamped', 'truncated'))}".strip(), 2),
        (f"signal {draw.choice(_SIGNALS)}", 2),
    )
    what = draw.choices([kind for kind, _ in kinds], [weight for _, weight in kinds])[0]
    return Fault(at=round(at, 2), what=what)
