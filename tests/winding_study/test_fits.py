"""Constants fitted to measurements: the rig, and the laws of a tensile test."""

import json

import numpy as np
import pytest

from cable_fem_node.identification import IdentificationError
from cable_fem_node.winding.prediction import predict
from cable_fem_node.winding.winding_config import WindingConfig
from winding_core.cable.cases import paper_case
from winding_core.cable.material_law import LAWS, MaterialLaw
from winding_core.helix import PAPER_FREE_LENGTH, FleetAngleLaw
from winding_core.lay.quasi_static import QuasiStaticLay
from winding_core.machine.drive import DriveProfile
from winding_core.machine.tension import RigTension
from winding_study.identification.tensile import TensileTest, fit_laws, judgement
from winding_study.paper.calibration import Calibration, calibrate

RIG = RigTension(
    offset=2.0, weight_share=0.4, diameter_gain=1.0, start_share=0.3, build_up_length=0.3
)
POISSON = 0.47
NOISE = 2.0e3


@pytest.fixture(scope="module")
def fitted() -> Calibration:
    return calibrate()


def test_without_pull_the_cable_lies_at_its_own_length() -> None:
    case = paper_case(1)
    # The 2 mm cable bends at the cost of 0.6 per mille; with no tension nothing else acts.
    none = RigTension(offset=0.0, weight_share=0.0)
    theta = QuasiStaticLay(case, "linear").theta(none)
    law = FleetAngleLaw(
        advance_per_radian=DriveProfile().advance_per_radian,
        free_length=PAPER_FREE_LENGTH,
        radius=case.centreline_radius,
    )
    fine = np.linspace(0.0, theta[-1], 20001)
    path = np.hypot(case.centreline_radius, law.slope(fine))
    length = np.sum(0.5 * (path[1:] + path[:-1]) * np.diff(fine))
    assert length == pytest.approx(case.original_length(4), rel=1e-3)


def test_more_pull_winds_every_marker_further() -> None:
    model = QuasiStaticLay(paper_case(9), "neo_hookean")
    little, more = (model.theta(RigTension(weight_share=share)) for share in (0.5, 1.0))
    assert (more > little).all()


def test_the_quasi_static_angles_are_the_rods() -> None:
    case = paper_case(6)
    rod = predict(WindingConfig(case=case, tension_law=RIG)).markers["theta"][1:]
    # The rod adds the stiff cable's lift-off at the landing point, some 0.2 % here.
    np.testing.assert_allclose(QuasiStaticLay(case, "linear").theta(RIG), rod, rtol=4e-3)


def test_the_fit_meets_its_bars(fitted: Calibration) -> None:
    assert len(fitted.residuals_pct) == 45
    assert fitted.in_sample_rms_pct <= 2.0
    assert fitted.leave_one_case_out_rms_pct <= 3.5
    # Leaving a case out cannot explain it better than fitting it.
    assert fitted.leave_one_case_out_rms_pct > fitted.in_sample_rms_pct


def test_the_fitted_rig_starts_soft_and_depends_little_on_the_weight(fitted: Calibration) -> None:
    tension = fitted.tension
    assert 0.0 < tension.start_share < 0.5
    assert 0.0 < tension.weight_share < 0.5
    assert all(error > 0.0 for error in fitted.standard_errors)


def test_the_calibration_is_strict_json(fitted: Calibration) -> None:
    read = json.loads(json.dumps(fitted.as_json(), allow_nan=False))
    assert read["tension"].keys() == read["standard_errors"].keys()
    rms = np.sqrt(np.mean([cell["dtheta_pct"] ** 2 for cell in read["cells"]]))
    assert rms == pytest.approx(read["in_sample_rms_pct"], rel=1e-9)


def curve(law: str, young: float = 2.6e6, ratio: float = 0.25, seed: int = 0) -> TensileTest:
    """Return forty points up to 100 % strain with a noise of 2 kPa, shuffled."""
    rng = np.random.default_rng(seed)
    strain = rng.permutation(np.linspace(0.0, 1.0, 40))
    bar = MaterialLaw(law=law, young=young, poisson=POISSON, mooney_ratio=ratio)
    stress = bar.nominal_stress(1.0 + strain) + NOISE * rng.standard_normal(strain.size)
    return TensileTest(strain=strain, stress=np.maximum(stress, 0.0))


@pytest.mark.parametrize("law", LAWS)
def test_law_that_made_the_curve_fits_best(law: str) -> None:
    fits = fit_laws(curve(law, ratio=1.0), POISSON)
    assert fits[0].law == law
    assert fits[0].rms == pytest.approx(NOISE, rel=0.4)
    # Three standard errors: 0.3 % of normal draws lie beyond.
    assert abs(fits[0].young - 2.6e6) < 3.0 * fits[0].young_standard_error
    assert judgement(fits).startswith(f"{law} fits best")


def test_standard_error_is_that_of_repeated_tests() -> None:
    fits = [fit_laws(curve("linear", seed=seed), POISSON, ["linear"])[0] for seed in range(60)]
    scatter = np.std([item.young for item in fits])
    stated = np.mean([item.young_standard_error for item in fits])
    # A deviation of sixty draws is itself known within 1 / sqrt(2 x 60) = 9 %; three of these.
    assert stated == pytest.approx(scatter, rel=0.28)


def test_share_of_the_second_constant_is_found() -> None:
    (found,) = fit_laws(curve("mooney_rivlin", ratio=1.0), POISSON, ["mooney_rivlin"])
    assert abs(found.share - 0.5) < 3.0 * found.share_standard_error
    assert found.material(POISSON).mooney_ratio == pytest.approx(1.0, rel=0.2)


def test_small_strains_cannot_tell_laws_apart() -> None:
    strain = np.linspace(0.0, 0.02, 12)
    rng = np.random.default_rng(3)
    stress = np.maximum(2.6e6 * strain + NOISE * rng.standard_normal(12), 0.0)
    assert "cannot be distinguished from it" in judgement(
        fit_laws(TensileTest(strain=strain, stress=stress), POISSON)
    )


def test_three_points_are_enough_for_a_modulus_but_not_for_a_verdict() -> None:
    test = TensileTest(strain=np.array([0.0, 0.1, 0.2]), stress=np.array([0.0, 0.26e6, 0.52e6]))
    fits = fit_laws(test, POISSON)
    linear = next(item for item in fits if item.law == "linear")
    assert linear.young == pytest.approx(2.6e6)
    assert judgement(fits) == "there are too few points to tell the laws apart"


def test_bad_table_is_refused() -> None:
    for strain, stress, sentence in [
        ([0.1, 0.2], [1e5, 2e5], "at least 3 points, got 2"),
        ([0.1, 0.2, np.nan], [1e5, 2e5, 3e5], "strain of point 3 must be finite, got nan"),
        ([0.1, 0.2, 0.3], [1e5, np.inf, 3e5], "stress of point 2 must be finite, got inf"),
        ([0.1, -0.2, 0.3], [1e5, 2e5, 3e5], "strain of point 2 must not be negative, got -0.2"),
        ([0.1, 0.2, 0.3], [1e5, 2e5, -3e5], "stress of point 3 must not be negative, got -300000"),
        ([0.1, 0.1, 0.1], [1e5, 1e5, 1e5], "at least 2 different positive strains"),
        ([0.1, 0.2, 0.3], [0.0, 0.0, 0.0], "a positive stress, all are zero"),
    ]:
        with pytest.raises(IdentificationError, match=sentence):
            TensileTest(strain=np.array(strain), stress=np.array(stress))
