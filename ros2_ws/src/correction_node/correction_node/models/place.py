"""Where a marker of known length lies: the guide's path, and what it leaves unexplained."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from correction_node.models.dataset import (
    Array,
    LengthCell,
    MarkerCondition,
    case_numbers,
    dimensionless_inputs,
    lengths,
)
from correction_node.models.process import NORMAL_90, Process
from winding_core.helix import PAPER_FREE_LENGTH
from winding_core.machine.drive import DriveProfile

SELECTION = (
    "The path has one free length for all cases and the process the dimensionless inputs and the "
    "ranges of the comparison's; among some forty forms tried with all 45 cells in view (guide "
    "offsets, advance, other inputs, a deviation of each run) it had nearly the smallest left-out "
    "error in z, 1.4 mm where plain paths have 1.5 to 1.7, so that error is optimistic."
)
# Advance of the guide [m/rad] and free length [m] that the solver has in the paper's cases.
PAPER_PATH = (DriveProfile().advance_per_radian, PAPER_FREE_LENGTH)
# Steps until z and theta of a length agree to a nanometre; each gains a factor of ten and more.
_STEPS = 30


@dataclass(frozen=True, kw_only=True)
class PlaceModel:
    """z of a marker at a wound angle: the fleet-angle law plus a process over what it misses."""

    free_length: float  # Of the span [m], one for all conditions
    process: Process | None  # z beyond the law's [m]; None for the law alone
    # Advance of the guide [m/rad] and free length [m] of the predictions beside the places.
    configured: tuple[float, float] = PAPER_PATH

    @property
    def advance(self) -> float:
        """Advance of the guide [m/rad]."""
        return self.configured[0]

    @property
    def predicted(self) -> PlaceModel:
        """The path of the predictions."""
        configured = self.configured
        return PlaceModel(free_length=configured[1], process=None, configured=configured)

    def place(self, conditions: Sequence[MarkerCondition], s: Array) -> tuple[Array, Array, Array]:
        """Return (theta [rad], z [m], standard deviation of z [m]) at lengths s [m], (n,) each.

        s is hypot((R + r) theta, z).
        """
        rho = radii(conditions)
        more, deviation = np.zeros(len(s)), np.zeros(len(s))
        if self.process is not None:
            more, deviation = self.process.at(dimensionless_inputs(conditions))
        theta = s / rho
        for _ in range(_STEPS):
            z = path(theta, self.free_length / rho, self.advance) + more
            theta = np.sqrt(np.maximum(s**2 - z**2, 0.0)) / rho
        return theta, z, deviation

    def slope(self, conditions: Sequence[MarkerCondition], theta: Array) -> Array:
        """Return dz / dS along the path at wound angles theta [rad], shape (n,)."""
        rho, nudge = radii(conditions), 1.0e-4
        lag = self.free_length / rho
        ahead = path(theta + nudge, lag, self.advance)
        rise = (ahead - path(theta, lag, self.advance)) / nudge
        return np.asarray(rise / np.hypot(rho, rise))

    def tensors(self) -> dict[str, Array]:
        """Return every number by name."""
        rest = {} if self.process is None else self.process.tensors("place")
        if self.configured != PAPER_PATH:
            rest["place.configured"] = np.array(self.configured)
        return {"place.free_length": np.array([self.free_length]), **rest}


def read_place(tensors: Mapping[str, Array]) -> PlaceModel | None:
    """Return the model among `tensors`; None where there is none.

    Raises:
        KeyError, ValueError: It is not whole.
    """
    if "place.free_length" not in tensors:
        return None
    advance, configured = tensors.get("place.configured", np.array(PAPER_PATH))
    return PlaceModel(
        free_length=float(tensors["place.free_length"][0]),
        process=Process.read("place", tensors),
        configured=(float(advance), float(configured)),
    )


def learn_place(
    cells: Sequence[LengthCell], configured: tuple[float, float] = PAPER_PATH
) -> PlaceModel:
    """Return the model of measured places: free length by least squares, then the process."""
    from scipy.optimize import least_squares  # noqa: PLC0415

    rho, (theta, z) = radii(cells), measured_places(cells)

    def missed(free_length: float) -> Array:
        return np.asarray(z - path(theta, free_length / rho, configured[0]))

    usual = configured[1]
    found = least_squares(lambda asked: missed(usual * np.exp(asked[0])) / usual, [0.0])
    free_length = float(usual * np.exp(found.x[0]))
    process = Process.fit(
        dimensionless_inputs(cells),
        missed(free_length),
        case_numbers(cells),
        np.array([cell.sigma_z for cell in cells]),
    )
    return PlaceModel(free_length=free_length, process=process, configured=configured)


def place_errors(
    cells: Sequence[LengthCell],
    models: Sequence[PlaceModel],
    held_out: Array,
    off_length: Array | float = 0.0,
) -> dict[str, float]:
    """Return mean errors of theta and z where each case is left out of lengths and places.

    Args:
        cells: The measured cells.
        models: One learned without each case, in order of the cases.
        held_out: h of each cell from a model that never saw its case, shape (n,).
        off_length: Half of the 90 % interval of each length that is not the place's own, relative.
    """
    cases, (theta, z) = case_numbers(cells), measured_places(cells)
    s = held_out * lengths(cells)[0]
    wide = np.broadcast_to(off_length, s.shape) * s
    off_theta, off_z, widths = (np.empty(len(cells)) for _ in range(3))
    for case, model in zip(np.unique(cases), models, strict=True):
        mine = np.flatnonzero(cases == case)
        asked = [cells[i] for i in mine.tolist()]
        found = model.place(asked, s[mine])
        off_theta[mine], off_z[mine] = found[0] - theta[mine], found[1] - z[mine]
        widths[mine] = np.hypot(NORMAL_90 * found[2], model.slope(asked, found[0]) * wide[mine])
    return {
        "theta_rad": round(float(np.abs(off_theta).mean()), 4),
        "z_mm": round(1e3 * float(np.abs(off_z).mean()), 4),
        "z_inside_90_pct": round(100.0 * float(np.mean(np.abs(off_z) <= widths)), 1),
    }


def path(theta: Array, lag: Array, advance: float) -> Array:
    """Return z [m] at wound angles theta [rad] with lag angles [rad], as `FleetAngleLaw.z`."""
    return np.asarray(advance * (theta + lag * np.expm1(-theta / lag)))


def radii(conditions: Sequence[MarkerCondition]) -> Array:
    """Return R + r [m] of each condition, shape (n,)."""
    return np.array([0.5 * (c.cylinder_diameter + c.cable_diameter) for c in conditions])


def measured_places(cells: Sequence[LengthCell]) -> tuple[Array, Array]:
    """Return (theta [rad], z [m]) of measured cells, shape (n,) each."""
    z = np.array([cell.z_exp for cell in cells])
    return np.sqrt(np.square(lengths(cells)[1]) - z**2) / radii(cells), z
