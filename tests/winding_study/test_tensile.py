"""Laws fitted to a tensile test."""

import numpy as np
import pytest

from cable_fem_node.identification import IdentificationError
from winding_core.cable.material_law import LAWS, MaterialLaw
from winding_study.identification.tensile import TensileTest, fit_laws, judgement

POISSON = 0.47
NOISE = 2.0e3


def curve(law: str, young: float = 2.6e6, ratio: float = 0.25, seed: int = 0) -> TensileTest:
    """Return forty points up to 100 % strain with a noise of 2 kPa, shuffled."""
    rng = np.random.default_rng(seed)
    strain = rng.permutation(np.linspace(0.0, 1.0, 40))
    bar = MaterialLaw(law=law, young=young, poisson=POISSON, mooney_ratio=ratio)
    stress = bar.nominal_stress(1.0 + strain) + NOISE * rng.standard_normal(strain.size)
    return TensileTest(strain=strain, stress=np.maximum(stress, 0.0))


def test_law_that_made_the_curve_fits_best() -> None:
    for law in LAWS:
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
