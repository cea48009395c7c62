"""Which cable of a library was wound, by where its markers lie."""

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import chdtrc, logsumexp

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.identification import FitConfig, IdentificationError, RigPrior, TrackedRun
from cable_fem_node.identification.quasi_static import lay
from cable_fem_node.identification.rod_run import wind
from cable_fem_node.identification.search import angle_covariance, chi_square, scatter_of
from winding_core.cable.condition import Condition
from winding_core.catalogue.cables import Cable
from winding_core.units import MILLIMETRE

# Relative standard deviation of the run's cable diameter, as of a caliper on a soft cable.
_CALIPER = 0.02
_FARTHEST = 5.0  # A diameter that is farther off, in standard deviations, is that of another cable
# The modulus is integrated over so many standard deviations of its logarithm to either side.
_REACH = 4.0
# Closed forms along that, between which angles are smooth, and places at which these are compared.
_KNOTS, _PLACES = 65, 8001
# Relative standard deviation of a modulus without one in its file: as of a material's data sheet.
_UNSTATED = 0.05
_YOUNG, _DIAMETER = "young_mpa", "cable_diameter_mm"


@dataclass(frozen=True, kw_only=True)
class Likeness:
    """How probable it is that a cable was the one that was wound."""

    name: str | None  # Of the library; None: a cable that is not in it
    probability: float  # All of them add up to one
    young: float  # Its most probable modulus [Pa]; NaN where it was not compared
    missed: float  # Root mean square of the angles' residuals at that modulus [rad]; NaN likewise
    refusal: str = ""  # Why the run cannot have been wound with it; empty where it can


@dataclass(frozen=True, kw_only=True)
class _Candidate:
    """A cable as the run would have been wound with it."""

    name: str | None
    run: TrackedRun
    deviation: float  # Standard deviation of ln E
    thicker: FloatArray  # Change of the angles with a standard deviation of the diameter, (m,)
    excess: FloatArray  # Angles of the rod over those of the closed form, shape (m,)
    thickness: float = 0.0  # ln of the likelihood of its diameter, over that of the run's


@dataclass(frozen=True, kw_only=True)
class _Comparison:
    log_likelihood: float
    young: float
    left: FloatArray  # Residuals at that modulus [rad], shape (m,)


def likenesses(run: TrackedRun, cables: Mapping[str, Cable]) -> tuple[Likeness, ...]:
    """Return how probable each cable is by the run's markers, most probable first.

    Before a marker is seen, every cable and "none of them" are equally probable; none of them has
    the configured cable's diameter and a modulus within a factor of 2 of it two times in three. The
    likelihood is that of the wound angles and of the diameter, integrated over what the file
    leaves open of modulus and diameter; angles are the rod's at the cable's modulus, continued by
    the closed form. Where not even the best cable explains the angles, all get the
    scatter that explains them.

    Args:
        run: Condition, machine and markers; cable and material of its condition are those of
            "none of them".
        cables: The library.

    Raises:
        IdentificationError: The configured cable cannot have been wound so.
    """
    none = _Candidate(
        name=None,
        run=run,
        deviation=math.log(RigPrior().young_factor),
        thicker=np.zeros_like(run.readings.theta),
        excess=_excess(run),
    )
    kept, refused = [none], []
    for name, cable in cables.items():
        try:
            kept.append(_candidate(name, run, cable))
        except ValueError as error:
            refused.append(_unlike(name, str(error)))
    share, scatter = FitConfig().model_share, 0.0
    found = [_compared(item, share, scatter) for item in kept]
    nearest = min(found, key=lambda one: chi_square(one.left, angle_covariance([run], share)))
    squares = chi_square(nearest.left, angle_covariance([run], share))
    degrees = nearest.left.size - 1
    if degrees > 0 and chdtrc(degrees, squares) < FitConfig().misfit_level:
        scatter = scatter_of(nearest.left, degrees, [run], share)
        found = [_compared(item, share, scatter) for item in kept]
    weights = np.array([one.log_likelihood for one in found])
    probabilities = np.exp(weights - logsumexp(weights))
    likely = [
        Likeness(
            name=item.name,
            probability=float(probability),
            young=one.young,
            missed=float(np.sqrt(np.mean(one.left**2))),
        )
        for item, one, probability in zip(kept, found, probabilities, strict=True)
    ]
    return (*sorted(likely, key=lambda one: -one.probability), *refused)


def _candidate(name: str, run: TrackedRun, cable: Cable) -> _Candidate:
    young, diameter = (cable.properties[key] for key in (_YOUNG, _DIAMETER))
    uncertain = cable.uncertainty.get(_DIAMETER, 0.0)
    wound = run.config.case.cable_diameter / MILLIMETRE
    read = math.hypot(uncertain / (_CALIPER * wound), 1.0)
    unlike = (diameter - wound) / (read * _CALIPER * wound)
    if abs(unlike) > _FARTHEST:
        raise IdentificationError(f"it is {diameter:.4g} mm thick, the run's cable {wound:.4g} mm")
    own = _wound_with(run, cable)
    thicker = np.zeros_like(run.readings.theta)
    if uncertain:
        wider = {**cable.properties, _DIAMETER: diameter + uncertain}
        other = _wound_with(run, replace(cable, properties=wider))
        thicker = lay(other, other.config.resolved.law)[0] - lay(own, own.config.resolved.law)[0]
    deviation = cable.uncertainty.get(_YOUNG, _UNSTATED * young) / young
    return _Candidate(
        name=name,
        run=own,
        deviation=deviation,
        thicker=thicker,
        excess=_excess(own),
        thickness=-0.5 * unlike**2 - math.log(read),
    )


def _excess(run: TrackedRun) -> FloatArray:
    law = run.config.resolved.law
    closed, _ = lay(run, law)
    return wind(run, law, closed)[0] / closed


def _wound_with(run: TrackedRun, cable: Cable) -> TrackedRun:
    """Return the run as it would have been with a cable.

    Raises:
        ValueError: The cable cannot be wound so.
    """
    case = run.config.case
    load = {
        "cylinder_diameter_mm": case.cylinder_diameter / MILLIMETRE,
        "tension_n": case.weight,
        "marker_spacing_mm": case.marker_spacing / MILLIMETRE,
        "markers": case.marker_count,
    }
    what = Condition.from_typed({**cable.properties, **load}).resolved()
    # Elements suit the winding of each cable.
    config = replace(run.config, case=what.case, segment_length=None, **what.law_values())
    return replace(run, config=config)


def _compared(item: _Candidate, model_share: float, scatter: float) -> _Comparison:
    """Return how well a cable explains the angles, its modulus and diameter integrated out.

    Args:
        item: The cable.
        model_share: Relative standard error of the angles that all have in common.
        scatter: That of each by itself.
    """
    run, law = item.run, item.run.config.resolved.law
    knots = np.linspace(-_REACH, _REACH, _KNOTS)
    reached, angles = [], []
    for knot in knots:
        # A much softer cable may be wound to its end too early.
        with suppress(IdentificationError):
            tried = replace(law, young=law.young * math.exp(knot * item.deviation))
            angles.append(lay(run, tried)[0] * item.excess)
            reached.append(knot)
    places = np.linspace(reached[0], reached[-1], _PLACES)
    left = CubicSpline(reached, angles)(places) - run.readings.theta
    covariance = angle_covariance([run], model_share, scatter)
    covariance += np.outer(item.thicker, item.thicker)
    squares = np.einsum("pm,pm->p", left @ np.linalg.inv(covariance), left)
    exponent = item.thickness - 0.5 * (squares + places**2)
    best = int(exponent.argmax())
    step = (places[1] - places[0]) / math.sqrt(2.0 * math.pi)
    size = np.linalg.slogdet(covariance)[1]
    return _Comparison(
        log_likelihood=float(logsumexp(exponent) + math.log(step) - 0.5 * size),
        young=law.young * math.exp(places[best] * item.deviation),
        left=left[best],
    )


def _unlike(name: str | None, refusal: str) -> Likeness:
    return Likeness(name=name, probability=0.0, young=math.nan, missed=math.nan, refusal=refusal)
