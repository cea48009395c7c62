"""Corrects the prediction of a running machine: by the learned factor, then by what it measures."""

from dataclasses import dataclass

import numpy as np

from correction_node.live.corrector import Corrector
from correction_node.live.measured_run import MeasuredRun
from correction_node.live.within_run import WithinRun
from correction_node.models.dataset import Array
from winding_core.cable.cases import Case, published_conditions
from winding_core.markers import Markers

# A measured marker further off than this many half-widths is an outlier: twice as far as
# the worst of the left-out cases ever was.
BELIEVED_WIDTHS = 2.0
# The rig is unknown until the run's own markers show how long its turns are: the paper's measured
# lengths are up to 23 % off an uncorrected prediction.
BELIEVED_SHARE = 0.25
# Prediction and measurement reach this node by different ways, and simulated time may lead the
# slower by 0.25 s. A correction that asks only for what was known twice as long ago [s] does not
# depend on which came first: a replay gives the same lengths as the run.
ARRIVAL = 0.5
_ROUNDING = 1.0e-3  # Table 1 prints its spacings to the millimetre
OUTSIDE_FACTOR = 2.0  # A guess, as for the factor: there is no data outside the trained conditions


@dataclass(frozen=True, kw_only=True)
class _Expected:
    """Length S_n, half-width of its interval, and how far off it a measurement may be [m]."""

    s: float
    half_width: float
    tolerance: float


class RunCorrector:
    """Corrects predicted markers, each from the markers measured before it.

    With nothing measured it is h S_FEM of the learned factor. With one measured marker P_m it is
    S_m + (h_n S_FEM_n - h_m S_FEM_m), with the factor's relative bound on what lies ahead. From
    two on it is the law within a run, with its own bounds, which no longer asks the factor. A
    marker's own measurement never corrects it, so what is published stays a prediction that can
    be judged by the measurement.

    A measured marker is taken only if it lies near what was expected of it: within twice the
    half-width, and for the first two within a quarter of what lies ahead if that is more.
    Otherwise it is rejected and reported, and no later marker is corrected by it.

    Attributes:
        measured: The markers that the tracker has measured.
        basis: Numbers of the measured markers that were in use in the newest correction.
        refusals: What spoke against the newest correction, sentences.
    """

    def __init__(self, corrector: Corrector, law: WithinRun | None, condition: Case) -> None:
        self._corrector = corrector
        self._law = law
        self._condition = condition
        self.measured = MeasuredRun(condition)
        self._widening = 1.0 if self.outside is None else OUTSIDE_FACTOR
        self.forget()

    def forget(self) -> None:
        """Begin a new run: nothing has been measured."""
        self.measured.forget()
        self.basis: tuple[int, ...] = ()
        self.refusals: tuple[str, ...] = ()

    @property
    def outside(self) -> str | None:
        """Why the law within a run is not known to hold here, or None."""
        outside = self._corrector.factor(self._condition).outside
        if outside is not None or self._law is None:
            return outside
        spacings = [row.marker_spacing for row in published_conditions().values()]
        low, high, mine = min(spacings), max(spacings), self._condition.marker_spacing
        if not low * (1.0 - _ROUNDING) <= mine <= high * (1.0 + _ROUNDING):
            return (
                f"marker_spacing {mine:.4g} m lies outside the trained range "
                f"{low:.4g} to {high:.4g} m: bounds within the run are doubled"
            )
        return None

    def correct(self, t: float, fem_markers: Markers) -> Markers:
        """Return corrected records of the usable wound markers.

        Args:
            t: Time of the prediction [s]; measurements count from `ARRIVAL` after them.
            fem_markers: MARKER_DTYPE records of the prediction, shape (n,).

        Returns:
            CORRECTED_DTYPE records, shape (m,), m <= n, with s = h s_fem.
        """
        count = self._condition.marker_count
        strange = fem_markers["id"] > count
        fem_markers = fem_markers[~strange]
        refusals = [
            *(["a marker that the cable does not have was predicted"] if strange.any() else []),
            *self._corrector.refusals(fem_markers, self._condition),
        ]
        corrected = self._corrector.correct(fem_markers, self._condition)
        predicted = self._by_marker(corrected, "s_fem")
        factored = self._by_marker(corrected, "s")
        widths = self._by_marker(corrected, "s_high") - factored
        measured = self.measured.known_at(t - ARRIVAL)
        accepted = np.full(count, np.nan)
        lengths = corrected["s"].copy()
        for row, marker in enumerate(corrected["id"].tolist()):
            if marker == 0:
                continue
            expected = self._expected(marker, predicted, factored, widths, accepted)
            lengths[row] = expected.s
            corrected["h"][row] = expected.s / predicted[marker - 1]
            corrected["s_low"][row] = max(0.0, expected.s - expected.half_width)
            corrected["s_high"][row] = expected.s + expected.half_width
            s = float(measured[marker - 1])
            if abs(s - expected.s) <= expected.tolerance:
                accepted[marker - 1] = s
            elif np.isfinite(s):
                refusals.append(
                    f"marker {marker} measured at {s:.4f} m is not used: expected "
                    f"{expected.s:.4f} m within {expected.tolerance:.4f} m"
                )
        if (lengths != corrected["s"]).any():
            slopes = self._corrector.slopes(fem_markers, self._condition)
            self._corrector.move(corrected, lengths, slopes)
        self.basis = tuple((np.flatnonzero(np.isfinite(accepted)) + 1).tolist())
        self.refusals = tuple(refusals)
        return corrected

    def _expected(
        self, marker: int, predicted: Array, factored: Array, widths: Array, accepted: Array
    ) -> _Expected:
        if self._law is not None:
            found = self._law.length_ahead(
                marker,
                spacing=self._condition.marker_spacing,
                predicted=predicted,
                measured=accepted,
            )
            if found is not None:
                half = self._widening * self._law.half_width(found)
                return _Expected(s=found.s, half_width=half, tolerance=BELIEVED_WIDTHS * half)
        s = float(factored[marker - 1])
        before = np.flatnonzero(np.isfinite(accepted[: marker - 1]))
        start, known = 0.0, 0.0
        if len(before):
            start, known = float(factored[before[-1]]), float(accepted[before[-1]])
        ahead = s - start
        half = float(widths[marker - 1]) / s * ahead
        tolerance = max(BELIEVED_WIDTHS * half, BELIEVED_SHARE * ahead)
        return _Expected(s=known + ahead, half_width=half, tolerance=tolerance)

    def _by_marker(self, records: Markers, field: str) -> Array:
        values = np.full(self._condition.marker_count, np.nan)
        cable = records["id"] > 0
        values[records["id"][cable] - 1] = records[field][cable]
        return values
