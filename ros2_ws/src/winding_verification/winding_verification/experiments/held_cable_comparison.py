"""DEFORM's cables: fitted on their training runs, judged by its loss on the held-out ones."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from cable_fem_node.dynamics.state import DivergenceError
from winding_verification.experiments.external_row import ExternalRow
from winding_verification.experiments.held_cable import HeldCable, loss, predict
from winding_verification.experiments.held_cable_fit import fit, usual_gaps
from winding_verification.experiments.motion_capture import FRAME_TIME, CapturedCable

NAME = "deform"
# Every cable stays below this many times its published figure, half of them below the figure.
_MOST = 1.5


class HeldCableComparison:
    """Cables one after the other, then how many of them reach what was published."""

    def __init__(self) -> None:
        self._reached: list[bool] = []

    def compare(self, runs: CapturedCable) -> Iterator[ExternalRow]:
        """Fit a cable on its training runs; yield its error on the held-out ones.

        Raises:
            ExternalFileError: There is no run to fit on.
            SolverError: A run diverges with the fitted cable.
        """
        gaps = usual_gaps(runs.train)
        cable = fit(runs.train, gaps)
        losses = []
        begun = time.process_time()
        for number, run in enumerate(runs.held_out, 1):
            try:
                losses.append(loss(predict(run, gaps, cable), run))
            except DivergenceError as error:
                raise DivergenceError(f"{runs.name}, held-out run {number}: {error}") from error
        spent = time.process_time() - begun
        told = sum(run.shape[0] - 2 for run in runs.held_out) * FRAME_TIME
        mean = float(np.mean(losses))
        if runs.published is not None:
            self._reached.append(mean <= runs.published)
        yield ExternalRow(
            experiment=NAME,
            variant=f"{runs.name}, {len(losses)} runs held out; {_described(cable)}",
            quantity="coordinate_error",
            computed=mean,
            bar=None if runs.published is None else _MOST * runs.published,
            at_least=False,
            published={} if runs.published is None else {"DEFORM": runs.published},
        )
        yield ExternalRow(
            experiment=NAME,
            variant=runs.name,
            quantity="processor_time_per_time",
            computed=spent / told,
            bar=None,
            at_least=False,
            published={},
        )

    def reached(self) -> Iterator[ExternalRow]:
        """Yield the share of the cables whose error is at most the published one."""
        if self._reached:
            yield ExternalRow(
                experiment=NAME,
                variant=f"{len(self._reached)} cables with a published figure",
                quantity="share_at_most_published",
                computed=float(np.mean(self._reached)),
                bar=0.5,
                at_least=True,
                published={},
            )


def _described(cable: HeldCable) -> str:
    first, second = cable.natural
    return (
        f"EI by mass {cable.bending:.3g}, viscosity {cable.viscosity:.3g}, drag {cable.drag:.2g}, "
        f"natural {first:.2g} {second:.2g}, own {cable.own:.2g}"
    )
