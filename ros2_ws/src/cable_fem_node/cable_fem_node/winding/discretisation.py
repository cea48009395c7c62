"""What the length of the elements costs a prediction, from winding it again with half of it."""

import dataclasses
from dataclasses import dataclass

from cable_fem_node.dynamics.state import FloatArray
from cable_fem_node.winding.prediction import PlannedRun, Prediction, Progress

# With errors that fall at least as fast as the length, Richardson's extrapolation takes away at
# most twice the difference of the two runs; with the square of the length four thirds of it.
_TWICE = 2.0


@dataclass(frozen=True, kw_only=True)
class DiscretisationError:
    """Estimated error of the markers P1..Pn, value minus limit of short elements."""

    segment: float  # Length of the elements of the prediction [m]
    finer_segment: float  # Of the run that it is compared with [m]
    # Of the wound angles [rad], shape (markers,); nan for those not wound in both runs.
    theta: FloatArray
    s: FloatArray  # Of the curve lengths [m], shape (markers,)


def discretisation_error(
    run: PlannedRun, result: Prediction, progress: Progress | None = None
) -> DiscretisationError:
    """Wind a run again with elements of half the length and compare.

    It takes about four times as long as the run itself. Of the solid only the distance of the
    sections is halved, not the mesh within them.

    Args:
        run: What was wound.
        result: Its outcome.
        progress: Called with the share done, 0..1.

    Raises:
        SolverError: As `PlannedRun.wind`.
    """
    segment = run.config.resolved.segment
    finer = dataclasses.replace(run.config, segment_length=0.5 * segment)
    other = dataclasses.replace(run, config=finer).wind(progress, whole=False)
    coarse, fine = result.markers[1:], other.markers[1:]
    loose = (coarse["flags"] | fine["flags"]) != 0
    theta, s = (_TWICE * (coarse[name] - fine[name]) for name in ("theta", "s"))
    theta[loose] = s[loose] = float("nan")
    return DiscretisationError(segment=segment, finer_segment=0.5 * segment, theta=theta, s=s)
