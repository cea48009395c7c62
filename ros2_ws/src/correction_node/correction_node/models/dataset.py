"""What a factor is learned from, and what a model of it looks at: cells, conditions, inputs."""

import csv
import hashlib
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from importlib.resources import files
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from winding_core.cable.cases import Case, Material, paper_case, published_markers
from winding_core.lay.quasi_static import QuasiStaticLay
from winding_core.machine.tension import DeadWeight

Array = NDArray[np.float64]

COLUMNS = ("case", "marker", "s_fem_m")
ROD_LENGTHS = "rod_lengths.csv"


@dataclass(frozen=True, kw_only=True)
class MarkerCondition:
    """Everything that h of one marker may depend on."""

    case: int  # Row of Table 1, or 0
    marker: int  # n of Pn
    cylinder_diameter: float  # [m]
    cable_diameter: float  # Undeformed [m]
    tension: float  # Nominal stress, weight over undeformed section [Pa]
    original_length: float  # n marker spacings [m]
    s_fem: float  # Predicted curve length S_n [m]
    young: float = Material().young  # As configured in the solver [Pa]

    @classmethod
    def of(cls, wound: Case, marker: int, s_fem: float, **further: Any) -> Self:
        """Return a marker of a case with its predicted length [m]; `further` fields win."""
        own: dict[str, Any] = {
            "case": wound.number,
            "marker": marker,
            "cylinder_diameter": wound.cylinder_diameter,
            "cable_diameter": wound.cable_diameter,
            "tension": wound.nominal_stress,
            "original_length": wound.original_length(marker),
            "s_fem": s_fem,
            "young": wound.material.young,
        }
        return cls(**own | further)


@dataclass(frozen=True, kw_only=True)
class LengthCell(MarkerCondition):
    """One measured cell of Tables 5 and 6, with a solver's prediction beside it."""

    s_exp: float  # Measured curve length S_n [m]
    z_exp: float = math.nan  # Measured axial position z_n [m], or NaN
    sigma: float = 0.0  # Standard deviation of s_exp, relative, where it is known
    sigma_z: float = 0.0  # Standard deviation of z_exp [m], where it is known
    cable: str = ""  # Which cable, where there are several


@dataclass(frozen=True, kw_only=True)
class DataSet:
    """The measured `cells` with the `name` that they were asked for by."""

    name: str
    cells: tuple[LengthCell, ...]
    own: bool = False  # Whether these are own runs and not the paper's cases
    refused: tuple[str, ...] = ()  # Own runs that are left out, with the reason
    # Advance of the guide [m/rad] and free length [m], where all own runs have the same.
    configured: tuple[float, float] | None = None

    @property
    def sha256(self) -> str:
        """Digest of the lengths, conditions and configured moduli, to nine digits."""
        left_out = {"z_exp", "sigma", "sigma_z", "cable", *(() if self.own else ("young",))}
        names = [item.name for item in fields(LengthCell) if item.name not in left_out]
        rows = (",".join(f"{getattr(cell, name):.9g}" for name in names) for cell in self.cells)
        return hashlib.sha256("\n".join(rows).encode()).hexdigest()


def load_data_set(name: str) -> DataSet:
    """Return the measured cells with the predictions of a solver.

    Args:
        name: ``paper`` for the paper's own simulation column, ``rod`` for this project's rod
            solver as shipped, or the path of a CSV file with the columns case, marker, s_fem_m;
            ``paper-N`` and ``rod-N`` leave case N out.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: The file is not a table of lengths.
    """
    shipped_name, _, left_out = name.partition("-")
    if shipped_name in ("paper", "rod") and left_out.isdecimal():
        cells = load_data_set(shipped_name).cells
        kept = tuple(cell for cell in cells if cell.case != int(left_out))
        if len(kept) == len(cells):
            raise ValueError(
                f"data set {name} leaves out case {left_out}, which {shipped_name} lacks"
            )
        return DataSet(name=name, cells=kept)
    if name == "paper":
        predicted = {(m.case, m.marker): m.simulation.s for m in published_markers()}
    elif name == "rod":
        shipped = files("correction_node").joinpath("data", ROD_LENGTHS)
        predicted = parse_lengths(shipped.read_text(encoding="utf-8"), source=ROD_LENGTHS)
    else:
        path = Path(name)
        if not path.is_file():
            raise FileNotFoundError(
                f"no data set {name}: give paper, rod, a CSV file or a folder of runs"
            )
        predicted = parse_lengths(path.read_text(encoding="utf-8"), source=path.name)
    return DataSet(name=name, cells=join_experiment(predicted, source=name))


def parse_lengths(text: str, *, source: str) -> dict[tuple[int, int], float]:
    """Return predicted lengths [m] by (case, marker) from CSV text.

    Raises:
        ValueError: A column or a number is missing, doubled, not finite or not positive.
    """
    reader = csv.DictReader(text.splitlines())
    try:
        rows = list(reader)
    except csv.Error as error:
        raise ValueError(f"{source} is no CSV text: {error}") from error
    missing = [name for name in COLUMNS if name not in (reader.fieldnames or ())]
    if missing:
        raise ValueError(f"{source} has no column {missing[0]}; it needs {', '.join(COLUMNS)}")
    predicted: dict[tuple[int, int], float] = {}
    for line, row in enumerate(rows, start=2):
        try:
            key = (int(row["case"]), int(row["marker"]))
            length = float(row["s_fem_m"])
        except (TypeError, ValueError) as error:
            raise ValueError(
                f"{source} line {line} is not a case, a marker and a length"
            ) from error
        if not (math.isfinite(length) and length > 0.0):
            raise ValueError(f"{source} line {line}: s_fem_m must be positive, got {length} m")
        if key in predicted:
            raise ValueError(f"{source} line {line}: case {key[0]} marker {key[1]} stands twice")
        predicted[key] = length
    return predicted


def format_lengths(predicted: Iterable[tuple[int, int, float]]) -> str:
    """Return (case, marker, length [m]) rows as the CSV text that `parse_lengths` reads."""
    rows = [f"{case},{marker},{length:.9f}" for case, marker, length in predicted]
    return "\n".join([",".join(COLUMNS), *rows, ""])


def join_experiment(
    predicted: dict[tuple[int, int], float], *, source: str
) -> tuple[LengthCell, ...]:
    """Return one cell for every marker that the paper measured.

    Raises:
        ValueError: A measured marker has no prediction.
    """
    cells = []
    for row in published_markers():
        if row.experiment is None:
            continue
        key = (row.case, row.marker)
        if key not in predicted:
            raise ValueError(f"{source} has no length of case {row.case} marker {row.marker}")
        measured = {"s_exp": row.experiment.s, "z_exp": row.experiment.z}
        case = paper_case(row.case)
        cells.append(LengthCell.of(case, row.marker, predicted[key], **measured))
    return tuple(cells)


def lengths(cells: Sequence[LengthCell]) -> tuple[Array, Array]:
    """Return (S_FEM, S_EXP) [m], each of shape (n,)."""
    return np.array([c.s_fem for c in cells]), np.array([c.s_exp for c in cells])


def case_numbers(cells: Sequence[MarkerCondition]) -> NDArray[np.int64]:
    """Return the case of each cell, shape (n,)."""
    return np.array([c.case for c in cells], dtype=np.int64)


Inputs = Callable[[Sequence[MarkerCondition]], Array]


def condition_inputs(conditions: Sequence[MarkerCondition]) -> Array:
    """Return (D_cylinder [m], D_cable [m], ln of the tension in Pa), shape (n, 3).

    The paper's three inputs; the same for all markers of a case. Its tensions span a factor of
    18 and double from case to case, so their logarithm is what is evenly spaced.
    """
    return np.array(
        [(c.cylinder_diameter, c.cable_diameter, math.log(c.tension)) for c in conditions]
    )


def dimensionless_inputs(conditions: Sequence[MarkerCondition]) -> Array:
    """Return (ln sigma / E, ln D_cylinder / D_cable, n spacing / (pi D_cylinder)), shape (n, 3).

    How far the weight strains the cable, how sharply the cylinder bends it, and how many turns
    of unstretched cable lie before the marker.
    """
    return np.array(
        [
            (
                math.log(c.tension / c.young),
                math.log(c.cylinder_diameter / c.cable_diameter),
                turns(c),
            )
            for c in conditions
        ]
    )


def cable_inputs(conditions: Sequence[MarkerCondition]) -> Array:
    """Return the dimensionless inputs and (ln E, ln D_cable), shape (n, 5).

    Cables whose moduli are wrong by other factors differ where sigma / E and D / d do not.
    """
    own = [(math.log(c.young), math.log(c.cable_diameter)) for c in conditions]
    return np.hstack([dimensionless_inputs(conditions), np.array(own)])


def strain(conditions: Sequence[MarkerCondition]) -> Array:
    """Return how far the weight strains a linear cable, sigma / E, shape (n,)."""
    return np.array([c.tension / c.young for c in conditions])


def turns(condition: MarkerCondition) -> float:
    """Return how many turns of unstretched cable lie before a marker: n spacing / (pi D)."""
    return condition.original_length / (math.pi * condition.cylinder_diameter)


INPUTS: dict[str, Inputs] = {
    "condition": condition_inputs,
    "dimensionless": dimensionless_inputs,
    "cable": cable_inputs,
}


def conditions_of(case: Case, law: str) -> tuple[MarkerCondition, ...]:
    """Return the conditions of a case's markers P1..Pn before anything is wound.

    Args:
        case: What is going to be wound.
        law: Material law of the solver whose lengths h multiplies. Its S_FEM is taken from the
            quasi-static lay-on under the dead weight, 0.14 % from the rod's at most.
    """
    reference = QuasiStaticLay(case, law).curve_lengths(DeadWeight())
    return tuple(
        MarkerCondition.of(case, marker, float(s_fem))
        for marker, s_fem in enumerate(reference, start=1)
    )
