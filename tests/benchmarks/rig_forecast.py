"""P3 and P4 of the paper's runs from their P1 and P2, by the posterior of the rig alone.

What is learned from other runs is how well markers were fixed and painted, two numbers; the run
that is judged is left out of it. All other ranges are those of `RigPrior`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from cable_fem_node.identification import (
    DEFAULT_SIGMA_THETA,
    DEFAULT_SIGMA_Z,
    Readings,
    RigPosterior,
    RigPrior,
    TrackedRun,
    identify_rig,
)
from cable_fem_node.identification.rig_lay import RigLay
from cable_fem_node.identification.rig_search import RigSearch
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.cases import paper_case, published_markers
from winding_core.machine.drive import PAPER_DURATION, DriveProfile
from winding_core.planned_inputs import planned_inputs

# Standard deviations that are tried [m].
_FIXING = (0.5e-3, 1.0e-3, 2.0e-3, 4.0e-3)
_SCATTER = (0.25e-3, 0.5e-3, 1.0e-3, 2.0e-3)

# ln of the evidence of every tried prior, by case.
Evidence = Mapping[int, Mapping[RigPrior, float]]


@dataclass(frozen=True, kw_only=True)
class RigForecast:
    """One run of the paper.

    Attributes:
        case: Row of Table 1.
        posterior: From P1 and P2.
        errors_pct: Measured over predicted length, less one, of P3 and P4 [%]; fewer where the
            paper measured none.
        inside: Whether each lay in its 90 % interval.
    """

    case: int
    posterior: RigPosterior
    errors_pct: tuple[float, ...]
    inside: tuple[bool, ...]


def paper_run(case: int, markers: int | None = None) -> TrackedRun:
    """Return the paper's measurement of a case as a run under its dead weight.

    Args:
        case: Row of Table 1.
        markers: How many of P1, P2, ... are used; None: all that were measured.
    """
    lays = [(item.experiment, n) for n, item in enumerate(published_markers(case), start=1)]
    known = [(lay, n) for lay, n in lays if lay is not None][:markers]
    return TrackedRun(
        config=WindingConfig(case=paper_case(case)),
        inputs=planned_inputs(DriveProfile(), PAPER_DURATION),
        readings=Readings(
            ids=np.array([n for _, n in known]),
            theta=np.array([lay.theta for lay, _ in known]),
            z=np.array([lay.z for lay, _ in known]),
            sigma_theta=np.full(len(known), DEFAULT_SIGMA_THETA),
            sigma_z=np.full(len(known), DEFAULT_SIGMA_Z),
        ),
    )


def evidence_of(cases: Sequence[int]) -> Evidence:
    """Return how well each tried scatter explains all markers of each case.

    Args:
        cases: Rows of Table 1.
    """
    tried = [
        RigPrior(fixing=fixing, scatter=scatter) for fixing, scatter in product(_FIXING, _SCATTER)
    ]
    found: dict[int, dict[RigPrior, float]] = {}
    for case in cases:
        run = paper_run(case)
        lays = [RigLay(run)]
        found[case] = {one: RigSearch([run], one, lays).evidence for one in tried}
    return found


def learned_prior(evidence: Evidence, left_out: int | None) -> RigPrior:
    """Return the tried prior of the greatest evidence over all cases but one."""
    others = [found for case, found in evidence.items() if case != left_out]
    return max(others[0], key=lambda prior: sum(found[prior] for found in others))


def forecast(case: int, prior: RigPrior, markers: int = 2) -> RigForecast:
    """Return the markers to come of a case from its first ones.

    Args:
        case: Row of Table 1.
        prior: Of the rig, with its case left out.
        markers: How many are used.
    """
    posterior = identify_rig([paper_run(case, markers)], prior)
    errors, inside = [], []
    measured = published_markers(case)
    for marker in posterior.ahead[0]:
        lay = measured[marker.id - 1].experiment
        if lay is not None:
            errors.append(100.0 * (lay.s / marker.s - 1.0))
            inside.append(marker.low <= lay.s <= marker.high)
    return RigForecast(
        case=case, posterior=posterior, errors_pct=tuple(errors), inside=tuple(inside)
    )
