"""Whether a plan would lay the cable over itself, which the contact model does not cover."""

from __future__ import annotations

import math

import numpy as np

from cable_fem_node.dynamics.points import FloatArray
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.machine.drive import DriveProfile
from winding_core.units import MILLIMETRE

FULL_TURN = 2.0 * math.pi

# Parts of a turn at which the lay of a guide that turns back is followed.
_PARTS = 180
# Of a plan that ends where it began [rad].
_ROUNDING = 1.0e-9
# More turns than this are not followed one by one.
_MOST_TURNS = 5000


class OverlapError(ValueError):
    """The cable would be wound over itself, which the contact model does not cover."""


def refuse_overlap(config: WindingConfig, drive: DriveProfile, duration: float) -> None:
    """Refuse a plan that lays a turn over another.

    A guide that keeps going needs a steady pitch of the cable's diameter, once there is more than
    a turn. The first turns lie closer than the steady pitch because the cable lags behind the
    guide; there neighbours may touch, as they do on the paper's stiffest cable, without riding up.
    Of a guide that turns back the lay itself is followed, by the fleet-angle law; what is unwound
    leaves the cylinder bare.

    Args:
        config: What is wound.
        drive: How the machine moves.
        duration: For how long [s].

    Raises:
        OverlapError: Turns would overlap, or are too many to be followed one by one.
    """
    width = config.case.cable_diameter * config.resolved.lateral
    t = np.linspace(0.0, duration, 2001)
    most = float(np.max(drive.positions(t)[0]))
    if most > FULL_TURN and abs(drive.pitch) < width:
        raise OverlapError(
            f"the guide advances {abs(drive.pitch) / MILLIMETRE:.3g} mm per turn, less than the "
            f"cable's {width / MILLIMETRE:.3g} mm: layers would overlap, "
            "and cable-on-cable contact is not modelled"
        )
    if np.ptp(np.sign(np.diff(np.asarray(drive.positions(t)[1])))) < 2.0:
        return
    if most > _MOST_TURNS * FULL_TURN:
        raise OverlapError(
            f"a guide that turns back is followed for {_MOST_TURNS} turns at most, "
            f"got {most / FULL_TURN:.4g}"
        )
    fine = np.linspace(0.0, duration, max(2, math.ceil(_PARTS * duration * _turn_rate(drive))))
    angle, guide = (np.asarray(values) for values in drive.positions(fine))
    lag = config.free_length / config.resolved.wound_radius
    refuse_crossing(angle, guide, lag, width)


def refuse_past_the_start(angle: FloatArray) -> None:
    """Refuse a cylinder that unwinds more than was wound; its angle [rad] over time, shape (n,).

    Raises:
        ValueError: Says how far it would turn back.
    """
    least = float(angle.min())
    if least < -_ROUNDING:
        raise ValueError(
            f"the cylinder would turn back to {least:.4g} rad, past the start, where nothing "
            "is wound any more: unwind for a shorter time"
        )


def refuse_crossing(angle: FloatArray, guide: FloatArray, lag: float, width: float) -> None:
    """Refuse a lay that comes closer than a width to a turn laid before.

    Neighbours of a guide that goes on as it began may touch; from where it has turned back, or
    falls below a width per turn, the lay counts.

    Args:
        angle: Of the cylinder over time [rad], shape (n,), from 0 on, not below 0.
        guide: Position of the guide [m], shape (n,).
        lag: Rotation in which the cable follows the guide, L / rho [rad].
        width: Of the cable [m].

    Raises:
        OverlapError: Says at which angle and position.
    """
    part = FULL_TURN / _PARTS
    lay = [0.0]
    place = np.concatenate([[0.0], np.zeros(int(angle.max() / part) + 1)])
    guided = np.zeros_like(place)
    steady = True
    for i in range(1, angle.size):
        last = int(angle[i] / part)
        del lay[last + 1 :]
        while len(lay) <= last:
            k = len(lay)
            share = (k * part - angle[i - 1]) / max(angle[i] - angle[i - 1], 1.0e-300)
            at = guide[i - 1] + min(max(share, 0.0), 1.0) * (guide[i] - guide[i - 1])
            lay.append(lay[-1] + (at - lay[-1]) * -math.expm1(-part / lag))
            place[k], guided[k] = lay[-1], at
            if k < _PARTS:
                continue
            steady = steady and abs(at - guided[k - _PARTS]) >= width
            if steady:
                continue
            apart = np.abs(place[k % _PARTS : k : _PARTS] - place[k])
            if apart.min() < width:
                raise OverlapError(
                    f"the guide turns back: after {k * part / FULL_TURN:.3g} turns the cable comes "
                    f"to lie at {place[k] / MILLIMETRE:.4g} mm, {apart.min() / MILLIMETRE:.3g} mm "
                    f"from a turn laid before, less than its {width / MILLIMETRE:.3g} mm: layers "
                    "would overlap, and cable-on-cable contact is not modelled"
                )


def _turn_rate(drive: DriveProfile) -> float:
    return abs(drive.angular_speed) / FULL_TURN
