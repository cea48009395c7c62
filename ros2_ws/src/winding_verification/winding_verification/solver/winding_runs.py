"""Winding: geometry, drive, fleet angle, quasi-static runs, lateral slip."""

import math

import numpy as np

from cable_fem_node.winding.prediction import Prediction, predict
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.cases import Case, paper_case
from winding_core.helix import PAPER_FREE_LENGTH, FleetAngleLaw, curve_length
from winding_core.machine.drive import DriveProfile
from winding_core.units import MILLIMETRE
from winding_verification.solver.suite import Values


def helix() -> Values:
    """W01: arc length of helices."""
    pitch = 18.055 * MILLIMETRE
    cases = {
        "rho16_turns1": (0.016, math.tau, pitch),
        "rho17_turns4": (0.017, 4 * math.tau, 4 * pitch),
        "rho33_turns4": (0.033, 4 * math.tau, 4 * pitch),
        "rho31_turns3.5": (0.031, 3.5 * math.tau, 42.0 * MILLIMETRE),
        "rho16_theta30.32": (0.016, 30.32, 50.15 * MILLIMETRE),
        "rho31_theta27.75": (0.031, 27.75, 60.9 * MILLIMETRE),
    }
    return {name: curve_length(*values) for name, values in cases.items()}


def drive() -> Values:
    """W02: the machine's ramp."""
    profile = DriveProfile()
    values: Values = {"pitch": profile.pitch}
    for t in (0.5, 1.0, 5.0, 10.0, 20.0, 21.0):
        values[f"theta_{t:g}"], values[f"guide_{t:g}"] = profile.positions(t)
    return values


def fleet_angle() -> Values:
    """W03: a limp cable, wound by the solver, follows the fleet-angle law."""
    values: Values = {}
    for rho in (0.016, 0.033):
        thin = Case(
            cylinder_diameter=2.0 * rho - 1.0e-3,
            cable_diameter=1.0e-3,
            weight=0.3,
            marker_spacing=0.1,
        )
        run = predict(WindingConfig(case=thin), duration=16.0, rate=5.0)
        name = f"rho{rho / MILLIMETRE:g}"
        for turn in (1, 2, 3, 4):
            values[f"z_{name}_turn{turn}"] = float(run.z_at(math.tau * turn))
    return values


def quasi_static() -> Values:
    """W04: the paper's conditions with a Neo-Hookean cable against quasi-static theory."""
    values: Values = {}
    for number in (1, 4, 6, 9, 11):
        run = predict(WindingConfig(case=paper_case(number), law="neo_hookean"), rate=5.0)
        values[f"stretch_{number}"] = run.stretch
        values[f"radius_{number}"] = run.config.resolved.radius_at(run.stretch)
        for row in run.markers[1:]:
            values[f"theta_{number}_{row['id']}"] = float(row["theta"])
            values[f"z_{number}_{row['id']}"] = float(row["z"])
    return values


def radius_convention() -> Values:
    """W05: the first marker's angle with the thinned radius and with the undeformed one."""
    model = WindingConfig(case=paper_case(2), law="neo_hookean").resolved
    stretch = model.law.stretch_at(1.249e6)
    length = 0.1 * stretch
    return {
        "thinned": length / model.radius_at(stretch),
        "undeformed": length / model.case.centreline_radius,
    }


def lateral_slip() -> Values:
    """C11: the path sticks while its lateral curvature stays below the friction."""
    profile = DriveProfile()
    case = paper_case(4)
    values: Values = {
        f"ratio_{length / MILLIMETRE:g}mm": profile.advance_per_radian / length
        for length in (PAPER_FREE_LENGTH, 0.025)
    }
    # Friction below and above the demand: where the first marker's place moves after landing.
    values["drift_sticking"] = _drift(predict(WindingConfig(case=case), duration=12.0))
    slippery = predict(WindingConfig(case=case, friction=0.005), duration=12.0)
    values["drift_slipping_over_tenth_mm"] = float(_drift(slippery) > 0.1 * MILLIMETRE)
    return values


def case_4() -> Values:
    """The specification's bars on case 4, with 5 mm segments."""
    run = predict(WindingConfig(case=paper_case(4)))
    case = run.config.case
    law = FleetAngleLaw(
        advance_per_radian=run.drive.advance_per_radian,
        free_length=run.config.free_length,
        radius=case.centreline_radius,
    )
    lengths = case.marker_spacing * run.stretch_closed_form * np.arange(1, 5)
    return {
        "z_1_off_kinematics": float(
            abs(run.markers["z"][1] - law.z(float(run.markers["theta"][1])))
        ),
        "s_off_closed_form": float(np.abs(run.markers["s"][1:] / lengths - 1.0).max()),
        "drift": _drift(run),
        "balance_pct": run.energy.balance_pct,
    }


def _drift(run: Prediction) -> float:
    track = run.history[:, 1]
    landed = track[track["flags"] == 0]
    return float(np.ptp(landed["z"]))
