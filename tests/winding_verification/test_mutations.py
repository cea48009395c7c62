"""`winding verify` notices a coefficient of the winding steppers that is wrong by 5 %.

The coefficient is changed where the model hands it to its compiled kernel, after everything that
follows from the configuration has been computed: only what the stepper computes is different.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable
from typing import Any

import pytest

from cable_fem_node.winding import rod_winding, solid_winding
from cable_fem_node.winding.rod_winding import RodWinding
from winding_verification.solver.suite import run_problem

Change = Callable[[dict[str, Any], float], None]


def field(argument: str, name: str) -> Change:
    """Return a change of one field of a named tuple among the kernel's arguments."""

    def change(arguments: dict[str, Any], factor: float) -> None:
        value = arguments[argument]
        arguments[argument] = value._replace(**{name: factor * getattr(value, name)})

    return change


def rod_touch(name: str) -> Change:
    def change(arguments: dict[str, Any], factor: float) -> None:
        k = arguments["k"]
        touch = k.touch._replace(**{name: factor * getattr(k.touch, name)})
        arguments["k"] = k._replace(touch=touch)

    return change


def masses(arguments: dict[str, Any], factor: float) -> None:
    arguments["mass"] = factor * arguments["mass"]


ROD: dict[str, tuple[str, Change]] = {
    "friction": ("V04", rod_touch("friction")),
    "contact stiffness": ("V05", rod_touch("normal_stiffness")),
    "bending stiffness": ("V03", field("k", "bending")),
    "axial stiffness": ("V01", field("response", "area")),
    "damping rate": ("V01", field("k", "damping_rate")),
    "density": ("V01", field("k", "mass")),
}
SOLID: dict[str, tuple[str, Change]] = {
    "friction": ("V12", field("touch", "friction")),
    "contact stiffness": ("V12", field("touch", "normal_stiffness")),
    "stiffness": ("V11", field("mesh", "constants")),
    "hourglass stiffness": ("V12", field("mesh", "hourglass")),
    "damping rate": ("V11", field("m", "damping_rate")),
    "density": ("V11", masses),
    "lag": ("V13", field("m", "free_length")),
}
FIVE_PERCENT = (0.95, 1.05)
# What went unnoticed before the problems were posed to the winding steppers.
GROSS = [("friction", 0.3), ("friction", 3.0), ("bending stiffness", 2.0), ("damping rate", 10.0)]


def change_kernel(
    monkeypatch: pytest.MonkeyPatch, module: Any, kernel: str, change: Change, factor: float
) -> None:
    """Let a module call its kernel with changed arguments."""
    real = getattr(module, kernel)
    signature = inspect.signature(getattr(real, "py_func", real))

    def advance(*given: Any) -> Any:
        bound = signature.bind(*given)
        change(bound.arguments, factor)
        return real(*bound.args)

    monkeypatch.setattr(module, kernel, advance)


def noticed(problem: str) -> list[str]:
    return [row.quantity for row in run_problem(problem) if not row.passed]


@pytest.mark.parametrize(
    ("name", "factor"), [*((name, factor) for name in ROD for factor in FIVE_PERCENT), *GROSS]
)
def test_a_wrong_coefficient_of_the_rod_is_noticed(monkeypatch, name, factor):
    problem, change = ROD[name]
    change_kernel(monkeypatch, rod_winding, "advance_winding", change, factor)
    assert noticed(problem), f"{name} x {factor} passes every row of {problem}"


@pytest.mark.parametrize("factor", FIVE_PERCENT)
def test_a_wrong_lag_of_the_rod_is_noticed(monkeypatch, factor):
    real = RodWinding.__init__

    def longer(self: RodWinding, config: Any) -> None:
        real(self, dataclasses.replace(config, free_length=factor * config.free_length))

    monkeypatch.setattr(RodWinding, "__init__", longer)
    assert noticed("V08")


@pytest.mark.campaign
@pytest.mark.slow
@pytest.mark.parametrize("factor", FIVE_PERCENT)
@pytest.mark.parametrize("name", SOLID)
def test_a_wrong_coefficient_of_the_solid_is_noticed(monkeypatch, name, factor):
    problem, change = SOLID[name]
    change_kernel(monkeypatch, solid_winding, "advance_solid_winding", change, factor)
    assert noticed(problem), f"{name} x {factor} passes every row of {problem}"
