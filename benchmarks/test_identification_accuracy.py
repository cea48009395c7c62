"""How well a hidden modulus comes back, and what the paper's own markers give.

Three things are measured: twelve cables' hidden moduli from P1 to P4 under the tracker's noise;
how often the truth lies within the stated half width; and, on the paper's twelve runs, how well a
modulus that P1 and P2 give predicts P3 and P4.
"""

from __future__ import annotations

import dataclasses
import time

import numpy as np
import pytest

from cable_fem_node.identification import (
    IdentificationError,
    ModulusEstimate,
    Readings,
    TrackedRun,
    identify_modulus,
    with_young,
)
from cable_fem_node.winding.prediction import Prediction, predict
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.cases import paper_case, published_markers
from winding_core.machine.drive import PAPER_DURATION, DriveProfile
from winding_core.markers import Markers, is_wound
from winding_core.run_inputs import planned_inputs

DRIVE = DriveProfile()
CASES = range(1, 13)
YOUNGS = (0.5e6, 1.2e6, 2.6e6, 8.0e6)
SEEDS = 4
FINE = 2.5e-3
# Below this strain of the span, the specification's 3 % is a tenth of a percent of the angle.
OBSERVABLE = 0.03


def readings(case: int, markers: Markers, rng: np.random.Generator) -> Readings:
    """Return markers with the tracker's noise of docs/vision.md."""
    big = paper_case(case).cylinder_diameter > 0.05
    sigma, sigma_z = (1.0e-3, 0.05e-3) if big else (3.0e-3, 0.12e-3)
    count = markers.size
    return Readings(
        ids=markers["id"].astype(np.int64),
        theta=markers["theta"] + sigma * rng.standard_normal(count),
        z=markers["z"] + sigma_z * rng.standard_normal(count),
        sigma_theta=np.full(count, sigma),
        sigma_z=np.full(count, sigma_z),
    )


def identified(case: int, found: Readings) -> ModulusEstimate:
    """Return the modulus that readings give, with the paper's as a start."""
    run = TrackedRun(
        config=WindingConfig(case=paper_case(case)),
        inputs=planned_inputs(DRIVE, PAPER_DURATION),
        readings=found,
    )
    return identify_modulus([run])


def wound(prediction: Prediction) -> Markers:
    """Return P1, P2, ... that have landed."""
    markers = prediction.markers[1:]
    landed: Markers = markers[is_wound(markers)]
    return landed


# Accuracy, not speed, and longer than all other benchmarks: run by its file alone.
@pytest.mark.campaign
@pytest.mark.timeout(3600)
def test_hidden_moduli_of_the_twelve_cables(bench) -> None:
    rng = np.random.default_rng(20)
    errors: dict[str, list[float]] = {"observable": [], "weak": []}
    inside, spent, left_out = [], [], []
    for case in CASES:
        for young in YOUNGS:
            strain = paper_case(case).nominal_stress / young
            fine = FINE * min(1.0, 1.15 / (1.0 + strain))
            hidden = dataclasses.replace(
                with_young(WindingConfig(case=paper_case(case)), young), segment_length=fine
            )
            try:
                truth = wound(predict(hidden, DRIVE, rate=2.0))
            except ValueError as error:
                left_out.append(f"case {case}, {young / 1e6:g} MPa: {error}")
                continue
            group = errors["observable" if strain >= OBSERVABLE else "weak"]
            for _ in range(SEEDS):
                started = time.process_time()
                found = identified(case, readings(case, truth, rng))
                spent.append(time.process_time() - started)
                group.append(100.0 * abs(found.young / young - 1.0))
                inside.append(abs(found.young - young) <= found.half_width_90)
                print(
                    f"case {case:2} E {young / 1e6:3g} MPa strain {strain:.3f} P1..P{truth.size}: "
                    f"error {group[-1]:.2f} %, half width "
                    f"{100.0 * found.half_width_90 / found.young:.2f} %, calls {found.fit.calls}"
                )
    print("not wound:", *left_out, sep="\n  ")
    bench.row("identify_worst_error_pct", max(errors["observable"]), "%", bar=3.0)
    bench.row("identify_worst_error_weak_strain_pct", max(errors["weak"]), "%")
    bench.row("identify_inside_share", float(np.mean(inside)), "", bar=0.9, at_least=True)
    bench.row("identify_cpu_s", float(np.mean(spent)), "CPU s")


@pytest.mark.timeout(3600)
def test_paper_runs_from_their_first_two_markers(bench) -> None:
    tabulated, updated = [], []
    for case in CASES:
        lays = [item.experiment for item in published_markers(case)]
        known = [lay for lay in lays if lay is not None]
        first = Readings(
            ids=np.array([1, 2]),
            theta=np.array([lay.theta for lay in known[:2]]),
            z=np.array([lay.z for lay in known[:2]]),
            sigma_theta=np.full(2, 3.0e-3),
            sigma_z=np.full(2, 0.12e-3),
        )
        config = WindingConfig(case=paper_case(case))
        updated_config, outcome = config, ""
        try:
            found = identified(case, first)
        except IdentificationError as error:
            outcome = str(error)
        else:
            outcome = found.refusal() or (
                f"{found.young / 1e6:.3f} MPa, half width {found.half_width_90 / found.young:.1%}"
                f", scatter {found.fit.scatter:.2%}"
            )
            if not found.refusal():
                updated_config = with_young(config, found.young)
        errors = []
        for store, model in ((tabulated, config), (updated, updated_config)):
            markers = predict(model, DRIVE, 25.0, rate=2.0).markers
            errors.append(
                [
                    100.0 * abs(lay.s / float(markers["s"][marker]) - 1.0)
                    for marker, lay in enumerate(lays, start=1)
                    if lay is not None and marker > 2
                ]
            )
            store.extend(errors[-1])
        print(f"case {case:2}: {np.round(errors[0], 2)} % -> {np.round(errors[1], 2)} %; {outcome}")
    bench.row("paper_p3_p4_error_tabulated_modulus_pct", float(np.mean(tabulated)), "%")
    bench.row("paper_p3_p4_error_identified_modulus_pct", float(np.mean(updated)), "%")
    # A modulus that predicts worse than the tabulated one would not be worth finding.
    assert np.mean(updated) < np.mean(tabulated)
