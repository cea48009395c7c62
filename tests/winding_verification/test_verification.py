"""Every problem of the verification suite, within its tolerance."""

from __future__ import annotations

import pytest

from winding_verification.solver.suite import PROBLEMS, references, run_problem

# More than a second of processor time.
SLOW = {"B07", "B08", "B10", "B11", "B17", "D03", "D05", "D10", "D10r", "V06", "V11", "W04"}
# More than five.
CAMPAIGN = {"V12", "V13"}


def marks(name: str) -> list[pytest.MarkDecorator]:
    campaign = [pytest.mark.campaign] if name in CAMPAIGN else []
    return [*campaign, pytest.mark.slow] if name in SLOW | CAMPAIGN else []


def test_every_problem_has_its_references():
    assert set(PROBLEMS) == set(references())


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=marks(name)) for name in sorted(PROBLEMS)]
)
def test_problem_is_within_its_tolerances(name):
    failed = [row for row in run_problem(name) if not row.passed]
    assert not failed, "\n".join(
        f"{row.quantity}: computed {row.computed}, reference {row.reference}, "
        f"error {row.error:.3g} above {row.tolerance:.3g}"
        for row in failed
    )


def test_unknown_problem_is_refused():
    with pytest.raises(ValueError, match="problem must be one of"):
        run_problem("Z99")
