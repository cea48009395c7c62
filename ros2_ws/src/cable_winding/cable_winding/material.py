"""Identify the material of a cable from its markers, or from a tensile test."""

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cable_fem_node.identification import (
    DEFAULT_SIGMA_THETA,
    DEFAULT_SIGMA_Z,
    Readings,
    TrackedRun,
    identify_modulus,
)
from cable_winding.prediction import Markers, run_parameters
from winding_core.cable.condition import Condition
from winding_core.run_inputs import planned_inputs
from winding_study.identification.sources import recorded_run
from winding_study.identification.tensile import LawFit, TensileTest, fit_laws

Source = Markers | str | PathLike[str]  # The markers of one run, or the recording that holds them


@dataclass(frozen=True, kw_only=True)
class Modulus:
    """An identified Young's modulus.

    Attributes:
        law: Material law that was fitted.
        young: Effective Young's modulus [Pa].
        standard_error: Of `young` [Pa].
        half_width_90: Half-width of the 90 % interval of `young` [Pa].
        id: Numbers of the markers that were used, all runs in turn, shape (k,).
        residual: Measured less fitted wound angle of each [rad], shape (k,).
        warning: Why the estimate must not be used; empty where nothing contradicts it.
    """

    law: str
    young: float
    standard_error: float
    half_width_90: float
    id: NDArray[np.int64]
    residual: NDArray[np.float64]
    warning: str


def identify(condition: Condition | Sequence[Condition], run: Source | Sequence[Source]) -> Modulus:
    """Identify Young's modulus by inverse winding: the rod is fitted to where markers lie.

    Args:
        condition: What was wound, with the material law and a first guess of `young`; one for each
            run where several runs of one cable are given.
        run: Markers of a run that went as the condition's drive, or a recording, whose measured
            motion and tension are used. Several runs as a sequence.

    Returns:
        The modulus with its uncertainty.

    Raises:
        ValueError: Numbers of conditions and runs differ, no marker is usable, or no modulus
            explains them.
    """
    sources = [run] if isinstance(run, Markers | str | PathLike) else list(run)
    conditions = [condition] * len(sources) if isinstance(condition, Condition) else condition
    if len(conditions) != len(sources):
        raise ValueError(f"{len(sources)} runs need as many conditions, got {len(conditions)}")
    found = identify_modulus([_run(*pair) for pair in zip(conditions, sources, strict=True)])
    residuals = found.fit.residuals
    return Modulus(
        law=found.law,
        young=found.young,
        standard_error=found.standard_error,
        half_width_90=found.half_width_90,
        id=np.array([row.id for row in residuals]),
        residual=np.array([row.theta - row.theta_fitted for row in residuals]),
        warning=found.refusal(),
    )


def _run(condition: Condition, source: Source) -> TrackedRun:
    plan = run_parameters(condition).plan()
    if isinstance(source, Markers):
        return TrackedRun(
            config=plan.config,
            inputs=planned_inputs(plan.drive, plan.duration),
            readings=_readings(source),
        )
    from winding_recorder.bags.tables import topic_rows  # noqa: PLC0415

    path = Path(source)
    return recorded_run(
        plan.config,
        tracked=topic_rows(path, "tracker/markers"),
        joints=topic_rows(path, "rig/joint_states"),
        tension=topic_rows(path, "rig/tension"),
    )


def _readings(markers: Markers) -> Readings:
    used = markers.wound & (markers.id > 0) & np.isfinite(markers.theta)
    sigma_theta, sigma_z = markers.sigma_theta[used], markers.sigma_z[used]
    return Readings(
        ids=markers.id[used],
        theta=markers.theta[used],
        z=markers.z[used],
        # A marker without a deviation of its own has that of the tracker.
        sigma_theta=np.where(sigma_theta > 0.0, sigma_theta, DEFAULT_SIGMA_THETA),
        sigma_z=np.where(sigma_z > 0.0, sigma_z, DEFAULT_SIGMA_Z),
    )


def fit_tensile(
    strain: ArrayLike, stress: ArrayLike, *, poisson: float = 0.47
) -> tuple[LawFit, ...]:
    """Fit every material law to a tensile test.

    Args:
        strain: Nominal strain, shape (n,), n >= 3.
        stress: Nominal stress [Pa], shape (n,).
        poisson: Poisson's ratio, which a test without lateral strain does not show.

    Returns:
        A fit per law, best first by Akaike's criterion, with the attributes `law`, `young` [Pa],
        `young_standard_error` [Pa], `share` (C01 over C10 + C01), `rms` [Pa] and `aicc`.

    Raises:
        ValueError: Points are too few, negative, not finite or not paired.
    """
    test = TensileTest(
        strain=np.asarray(strain, dtype=float), stress=np.asarray(stress, dtype=float)
    )
    return fit_laws(test, poisson)
