"""Learn and apply the correction of predicted lengths, as an estimator of scikit-learn."""

import math
from os import PathLike
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cable_winding.prediction import Prediction
from correction_node.models.dataset import DataSet, LengthCell, load_data_set
from correction_node.models.weights import (
    TrainedFactor,
    load_factor,
    save_factor,
    weights_directory,
)
from winding_core.cable.cases import Case

FloatArray = NDArray[np.float64]

# Columns of X: SI units, the number n of Pn, and the predicted length from P0.
FEATURES = ("cylinder_diameter", "cable_diameter", "weight", "marker_spacing", "marker", "s_fem")


def load_lengths(data: str = "rod") -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """Return the paper's 45 measured lengths with their predictions, as training data.

    Args:
        data: ``rod`` for this solver's predictions, ``paper`` for the paper's simulation, or a CSV
            file with the columns case, marker, s_fem_m.

    Returns:
        X, shape (n, 6), columns FEATURES; y, measured lengths [m], shape (n,); groups, the case
        of each row, shape (n,).

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: The file is not a table of lengths.
    """
    cells = load_data_set(data).cells
    x = [
        (
            cell.cylinder_diameter,
            cell.cable_diameter,
            0.25 * math.pi * cell.cable_diameter**2 * cell.tension,
            cell.original_length / cell.marker,
            cell.marker,
            cell.s_fem,
        )
        for cell in cells
    ]
    return (
        np.array(x, dtype=float),
        np.array([cell.s_exp for cell in cells]),
        np.array([cell.case for cell in cells]),
    )


class Correction:
    """Learned factor on predicted lengths: y = h(X) s_fem.

    Outside the conditions that it was fitted to it does not extrapolate: h is 1 there, and the
    interval is wide.

    Args:
        model: ``rig network``, ``rig``, ``marker network`` or ``network`` (the paper's).
        steps: Training steps of a network.
        seed: Of its starting weights.

    Attributes:
        factor_: The fitted factor, after `fit` or `load`.
        errors_: Mean errors in percent: in_sample_pct, leave_one_case_out_pct,
            worst_case_left_out_pct.
    """

    def __init__(self, model: str = "rig network", *, steps: int = 1500, seed: int = 0) -> None:
        self.model = model
        self.steps = steps
        self.seed = seed
        self.factor_: TrainedFactor | None = None

    @classmethod
    def load(cls, weights: str | PathLike[str] = "rod") -> Self:
        """Return a fitted correction from a folder of weights, or from shipped ones by name.

        Raises:
            FileNotFoundError: There are no weights.
            ValueError: They are damaged.
        """
        factor = load_factor(weights_directory(str(weights)))
        own = cls(factor.name)
        own.factor_ = factor
        return own

    def save(self, folder: str | PathLike[str]) -> None:
        """Write the weights and their card, for `winding run --weights`."""
        save_factor(self._fitted(), Path(folder))

    @property
    def errors_(self) -> dict[str, float]:
        """Mean errors in percent, in-sample and with each case left out."""
        return self._fitted().errors

    def fit(self, X: ArrayLike, y: ArrayLike, groups: ArrayLike | None = None) -> Self:
        """Learn the factor; needs the extra `train`.

        Args:
            X: Shape (n, 6), columns FEATURES.
            y: Measured lengths from P0 [m], shape (n,).
            groups: Which run each row belongs to, shape (n,), nine runs at least; None: rows of
                one cylinder, cable, weight and spacing are one run.

        Returns:
            This estimator.

        Raises:
            ValueError: Shapes differ, runs are too few for an interval, or the predictions are
                not those that the model is for.
        """
        from correction_node.training.protocol import learn  # noqa: PLC0415
        from correction_node.training.training import TrainingConfig  # noqa: PLC0415

        rows, measured = _rows(X), np.asarray(y, dtype=float)
        if measured.shape != (len(rows),):
            raise ValueError(f"y must have shape ({len(rows)},), got {measured.shape}")
        labels = rows[:, :4] if groups is None else np.asarray(groups).reshape(len(rows), -1)
        runs = np.unique(labels, axis=0, return_inverse=True)[1].reshape(-1) + 1
        cells = tuple(
            _cell(row, int(run), length)
            for row, run, length in zip(rows, runs, measured.tolist(), strict=True)
        )
        config = TrainingConfig(steps=self.steps)
        data = DataSet(name="own", cells=cells)
        self.factor_ = learn(data, self.model, config, lambda _: None, seed=self.seed).factor
        return self

    def predict(self, X: ArrayLike | Prediction) -> FloatArray:
        """Return corrected lengths from P0 [m], shape (n,).

        Args:
            X: Shape (n, 6), columns FEATURES; or a prediction, for its wound markers P1 to Pn. A
                prediction also brings its material, which an array leaves at the fitted one.
        """
        return self._corrected(X)[0]

    def predict_interval(self, X: ArrayLike | Prediction) -> tuple[FloatArray, FloatArray]:
        """Return lower and upper ends [m], each of shape (n,), of the intervals of `predict`.

        They hold 12 of 13 new cases that are drawn like the fitted ones.
        """
        corrected, width = self._corrected(X)
        return corrected * np.maximum(0.0, 1.0 - width), corrected * (1.0 + width)

    def _fitted(self) -> TrainedFactor:
        if self.factor_ is None:
            raise ValueError("this correction is not fitted: call fit or load first")
        return self.factor_

    def _corrected(self, x: ArrayLike | Prediction) -> tuple[FloatArray, FloatArray]:
        """Return corrected lengths [m] and relative half-widths, each of shape (n,)."""
        trained = self._fitted()
        if isinstance(x, Prediction):
            what = x.condition.resolved()
            factor = trained.factor(what.case, what.law)
            used = x.markers.wound & (x.markers.id > 0)
            h = np.array(factor.by_marker)[x.markers.id[used] - 1]
            return h * x.markers.s[used], np.full(h.shape, factor.relative_bound)
        rows = _rows(x)
        factors = [trained.factor(_case(row)) for row in rows]
        h = np.array([factor.by_marker[-1] for factor in factors])
        return h * rows[:, 5], np.array([factor.relative_bound for factor in factors])


def _rows(x: ArrayLike) -> FloatArray:
    """Return X as an array, shape (n, 6)."""
    rows = np.asarray(x, dtype=float)
    if rows.ndim != 2 or rows.shape[1] != len(FEATURES):
        raise ValueError(f"X must have the columns {', '.join(FEATURES)}, got shape {rows.shape}")
    return rows


def _case(row: FloatArray) -> Case:
    cylinder, cable, weight, spacing, marker, _ = row.tolist()
    return Case(
        cylinder_diameter=cylinder,
        cable_diameter=cable,
        weight=weight,
        marker_spacing=spacing,
        marker_count=int(marker),
    )


def _cell(row: FloatArray, run: int, length: float) -> LengthCell:
    case = _case(row)
    return LengthCell.of(case, case.marker_count, float(row[5]), case=run, s_exp=length)
