"""Where markers will land under control, and how well that is known before the run."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lay_control_node.control.control_parameters import ControlParameters
from lay_control_node.control.guide_law import WantedLay
from lay_control_node.control.lay_controller import UNWOUND
from lay_control_node.control.stretch_filter import StretchEstimate
from winding_core.cable.condition import ResolvedCondition
from winding_core.lay.records import ControlMode

Array = NDArray[np.float64]

_STEP = 0.05  # Steps of the wound angle [rad]
# A marker is measured so far behind the contact line [rad], with such a deviation [rad].
_SEEN_AFTER, _SIGMA_SEEN = 0.3, 1.0e-3
_UNUSUAL = 2.2  # An unusual rig is off by so many deviations
_LEAST = 1.0e-9  # Nothing moves by less [rad]
_BEYOND = 20.0  # A run ends so many radians behind the last wanted marker


@dataclass(frozen=True, kw_only=True)
class ExpectedLanding:
    """A wanted marker under control."""

    number: int  # Of the marker
    wanted: float  # Wound angle [rad]
    expected: float  # Where it lands if the tension at lay-on is that of the prior [rad]
    # One standard deviation of that [rad], of the prior of that tension, and of what its law leaves
    # out.
    sigma: float
    # Its larger miss under two rigs that are 2.2 deviations off where that moves the first marker
    # most [rad]: the pull may come to its bounds there.
    unusual: float

    @property
    def misses(self) -> float:
        """By how much it may miss its angle [rad]: one rig in twenty at most does by more."""
        usual = abs(self.expected - self.wanted) + 2.0 * self.sigma
        return max(usual, self.unusual) if math.isfinite(self.unusual) else math.nan


def expected_landings(
    control: ControlParameters,
    what: ResolvedCondition,
    wanted: WantedLay,
    markers: Mapping[int, float],
) -> tuple[ExpectedLanding, ...]:
    """Wind markers under control, each parameter of the tension moved by its deviation in turn.

    Then with all of them moved together, to either side, where that moves the first marker most.

    The cable sticks where it lands; the pull is the commanded one. Markers are measured behind
    the contact line, so the first one adds nothing until it lies.

    Args:
        control: Priors, and the range of the pull.
        what: What is wound.
        wanted: The lay.
        markers: Wound angle at which a marker is wanted [rad], by marker.
    """
    if not markers:
        return ()
    controller = control.controller(what, wanted, markers=markers, mode=ControlMode.DRIVE)
    mean = controller.stretch.estimate
    nominal = _landed(control, what, wanted, markers, mean)
    numbers = sorted(markers)

    def landed(change: Array) -> Array:
        found = _landed(control, what, wanted, markers, mean.moved(change))
        return np.array([found[number] for number in numbers])

    deviations = np.diag(np.sqrt(np.diag(mean.covariance)))
    slopes = np.array([0.5 * (landed(one) - landed(-one)) for one in deviations])
    variance = dict(zip(numbers, np.sum(slopes**2, axis=0).tolist(), strict=True))
    # The rigs that are off together in what moves the first marker most.
    steepest = slopes[:, 0] / max(float(np.linalg.norm(slopes[:, 0])), _LEAST)
    ends = np.array([landed(side * steepest @ deviations) for side in (-_UNUSUAL, _UNUSUAL)])
    aims = np.array([markers[number] for number in numbers])
    unusual = dict(zip(numbers, np.abs(ends - aims).max(axis=0).tolist(), strict=True))
    radius, before = what.case.centreline_radius, 0.0
    for number in numbers:
        # Unobservable: by how much the brake's own friction keeps the tension off its law.
        segment = nominal[number] - before
        stretched = max(radius * segment / what.case.marker_spacing - 1.0, 0.0)
        friction = controller.stretch.config.tension_error * stretched * segment
        variance[number] += friction**2
        # It holds every change of the pull back, so it adds to the misses that are corrected.
        unusual[number] += friction
        before = nominal[number]
    return tuple(
        ExpectedLanding(
            number=number,
            wanted=angle,
            expected=nominal[number],
            sigma=math.sqrt(variance[number]),
            unusual=unusual[number],
        )
        for number, angle in sorted(markers.items())
    )


def _landed(
    control: ControlParameters,
    what: ResolvedCondition,
    wanted: WantedLay,
    markers: Mapping[int, float],
    true: StretchEstimate,
) -> dict[int, float]:
    """Return the angle [rad] at which each marker lands under a true tension; nan for never."""
    case = what.case
    controller = control.controller(what, wanted, markers=markers, mode=ControlMode.DRIVE)
    landing, stretch = controller.landing, controller.stretch
    assert landing is not None
    end = max(markers.values()) + _BEYOND
    theta = laid = 0.0
    pull, unseen = case.weight, dict[int, float]()
    found = dict.fromkeys(range(1, max(markers) + 1), math.nan)
    ahead = 1
    while ahead <= max(markers) and theta < end:
        slope = wanted.at(theta).slope
        stretch.advance(theta, pull, slope)
        pull = landing.pull(stretch.progress(theta), stretch.estimate, pull, free=theta <= UNWOUND)
        tension = true.tension(pull, case.centreline_radius * theta)
        density = float(landing.law.density(tension, slope))
        theta += _STEP
        laid += density * _STEP
        while ahead <= max(markers) and laid >= ahead * case.marker_spacing:
            found[ahead] = theta - (laid - ahead * case.marker_spacing) / density
            unseen[ahead] = found[ahead]
            ahead += 1
        for number in [n for n, at in unseen.items() if theta > at + _SEEN_AFTER]:
            stretch.land(number, unseen.pop(number), _SIGMA_SEEN)
    return found
