"""A published table of how much a stiff rod holds on a capstan, beside this rod."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from winding_verification.experiments.elastic_capstan import (
    lift_off,
    limiting_ratio,
    slipping_ratio,
)
from winding_verification.experiments.external_row import ExternalRow
from winding_verification.experiments.scenario import ExternalFileError

NAME = "elastic_capstan"
TABLE = "elastic_capstan.csv"
LIMITS = {
    "friction": (0.0, 2.0),
    "wrap_angle_rad": (0.1, 4.0 * math.pi),
    "stiffness": (1.0e-4, 1.0),
    "force_ratio": (0.5, 50.0),
}
# What a table read off a figure allows; the rod is within 0.6 % of the closed form.
_BAR = 2.0e-2


@dataclass(frozen=True, kw_only=True)
class CapstanPoint:
    """One point of the table.

    Attributes:
        friction: Coulomb's coefficient.
        wrap_angle_rad: Angle between the two pulls [rad].
        stiffness: EI / (F R^2), F the light pull, R the radius of the rod's centreline.
        force_ratio: Strong over light pull when it begins to slide.
    """

    friction: float
    wrap_angle_rad: float
    stiffness: float
    force_ratio: float


def read_table(file: Path) -> list[CapstanPoint]:
    """Return the points of a table.

    Raises:
        ExternalFileError: It is not one; names the line, the value and the limit.
    """
    try:
        with file.open(newline="", encoding="utf-8") as stream:
            rows = list(csv.DictReader(stream))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ExternalFileError(f"{file} cannot be read: {error}") from error
    points = [_point(f"{file}, line {line}", row) for line, row in enumerate(rows, 2)]
    if not points:
        raise ExternalFileError(f"{file} has no line under its columns {', '.join(LIMITS)}")
    return points


def compare_points(points: Sequence[CapstanPoint]) -> Iterator[ExternalRow]:
    """Let this rod slide at every point of a table; yield how far off its ratio is.

    Raises:
        SolverError: The rod does not slide.
    """
    for point in points:
        told = (point.friction, point.wrap_angle_rad, point.stiffness)
        yield ExternalRow(
            experiment=NAME,
            variant="friction {:g}, wrap {:g} rad, stiffness {:g}".format(*told),
            quantity="force_ratio_error",
            computed=slipping_ratio(*told) / point.force_ratio - 1.0,
            bar=_BAR,
            at_least=False,
            published={"closed form": limiting_ratio(*told) / point.force_ratio - 1.0},
        )


def _point(place: str, row: dict[str, str]) -> CapstanPoint:
    values = {}
    for name, (least, most) in LIMITS.items():
        told = row.get(name)
        try:
            value = float(told or "")
        except ValueError:
            raise ExternalFileError(f"{place}: {name} must be a number, got {told!r}") from None
        if not least <= value <= most:
            raise ExternalFileError(
                f"{place}: {name} must lie in [{least:g}, {most:g}], got {told}"
            )
        values[name] = value
    point = CapstanPoint(**values)
    if point.wrap_angle_rad <= 2.0 * lift_off(point.stiffness):
        raise ExternalFileError(
            f"{place}: a rod of stiffness {point.stiffness:g} wrapped by "
            f"{point.wrap_angle_rad:g} rad does not lie on the capstan"
        )
    return point
