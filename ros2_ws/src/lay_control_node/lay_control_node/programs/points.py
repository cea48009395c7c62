"""Points of a program and tables of them: an angle or a length, z, tension and marker."""

from __future__ import annotations

import csv
import difflib
import io
import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field

from winding_core.lay.program import LayProgram, LayProgramError
from winding_core.units import MILLIMETRE

FULL_TURN = 2.0 * math.pi
MOST_POINTS = 100_000
MOST_TURNS = 10_000.0  # An hour at full speed is less

# Column -> one of it in radians or metres.
ANGLES = {"theta_rad": 1.0, "theta_deg": math.pi / 180.0, "turns": FULL_TURN}
LENGTHS = {"length_m": 1.0, "length_mm": MILLIMETRE}
AXIAL = {"z_m": 1.0, "z_mm": MILLIMETRE}
TENSION, MARKER = "tension_n", "marker"
COLUMNS = (*ANGLES, *LENGTHS, *AXIAL, TENSION, MARKER)

Number = Callable[[str], float]


@dataclass(frozen=True, kw_only=True)
class Columns:
    """Which columns a table has."""

    along: str  # Of the wound angle or of the length of the laid cable
    z: str  # Of the axial position

    @classmethod
    def of(cls, names: Collection[str], where: str) -> Columns:
        """Choose among names of columns.

        Raises:
            LayProgramError: One is unknown or missing, or one is there twice.
        """
        for name in names:
            if name not in COLUMNS:
                near = difflib.get_close_matches(name, COLUMNS, n=1)
                hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(COLUMNS)}"
                raise LayProgramError(f"{where} has an unknown column {name[:40]!r}; {hint}")
        return cls(
            along=_one((*ANGLES, *LENGTHS), names, where), z=_one(tuple(AXIAL), names, where)
        )


@dataclass(kw_only=True)
class PointList:
    """Points of a program, added one by one."""

    radius: float  # Of the laid cable's centreline [m]
    theta: list[float] = field(default_factory=list)  # Wound angles so far [rad]
    z: list[float] = field(default_factory=list)  # Axial positions so far [m]
    tension: list[float] = field(default_factory=list)  # Pulls so far [N]; nan for the condition's
    # Wound angle of marker n so far [rad], by n.
    markers: dict[int, float] = field(default_factory=dict)
    length: float = 0.0  # Of the laid cable so far [m]

    def add_row(self, columns: Columns, cells: dict[str, object], place: str) -> None:
        """Add a row of a table.

        Args:
            columns: Of the table.
            cells: By column; None or an empty text for none.
            place: Of the row, for a refusal.

        Raises:
            LayProgramError: A cell is no number, or the point cannot follow the one before.
        """

        def number(name: str) -> float:
            return finite_number(cells.get(name), f"{place}: {name}")

        z = AXIAL[columns.z] * number(columns.z)
        if columns.along in LENGTHS:
            theta = self._angle_at(LENGTHS[columns.along] * number(columns.along), z, place)
        else:
            theta = ANGLES[columns.along] * number(columns.along)
        tension = math.nan if _empty(cells.get(TENSION)) else number(TENSION)
        marker = 0 if _empty(cells.get(MARKER)) else _marker_number(cells[MARKER], place)
        self.add(theta, z, tension, place)
        if marker in self.markers:
            raise LayProgramError(f"{place}: marker {marker} is there twice")
        if marker:
            self.markers[marker] = theta

    def add(self, theta: float, z: float, tension: float, place: str) -> None:
        """Add a point at an angle [rad], z [m], tension [N] or nan.

        Raises:
            LayProgramError: It does not begin at P0, does not ascend, or there are too many.
        """
        if not self.theta and (theta, z) != (0.0, 0.0):
            raise LayProgramError(
                f"{place}: a program begins at P0, at 0 rad and 0 mm, "
                f"got {theta:g} rad and {z / MILLIMETRE:g} mm"
            )
        if self.theta and not theta > self.theta[-1]:
            raise LayProgramError(
                f"{place}: wound angles must ascend, got {theta:g} rad after {self.theta[-1]:g} rad"
            )
        if theta > FULL_TURN * MOST_TURNS:
            raise LayProgramError(
                f"{place}: a program has at most {MOST_TURNS:g} turns, got {theta / FULL_TURN:g}"
            )
        if len(self.theta) >= MOST_POINTS:
            raise LayProgramError(f"{place}: a program has at most {MOST_POINTS} points")
        if tension < 0.0:
            raise LayProgramError(f"{place}: tension must not be negative, got {tension:g} N")
        if self.theta:
            way = self.radius * (theta - self.theta[-1])
            self.length += math.hypot(way, z - self.z[-1])
        self.theta.append(theta)
        self.z.append(z)
        self.tension.append(tension)

    def program(self, name: str, remarks: Sequence[str] = ()) -> LayProgram:
        """Return the program.

        Raises:
            LayProgramError: Two points are too few, or a marker is out of order.
        """
        return LayProgram(
            theta=self.theta,  # type: ignore[arg-type]
            z=self.z,  # type: ignore[arg-type]
            tension=self.tension,  # type: ignore[arg-type]
            markers=self.markers,
            name=name,
            remarks=tuple(remarks),
        )

    def _angle_at(self, length: float, z: float, place: str) -> float:
        if not self.theta:
            return length / self.radius
        step, rise = length - self.length, z - self.z[-1]
        if not step > abs(rise):
            raise LayProgramError(
                f"{place}: {step / MILLIMETRE:g} mm of cable cannot cover "
                f"{abs(rise) / MILLIMETRE:g} mm of z and wind on"
            )
        return self.theta[-1] + math.sqrt((step - rise) * (step + rise)) / self.radius


def finite_number(value: object, what: str) -> float:
    """Return a number that was given as one or as its text.

    Raises:
        LayProgramError: It is none, or not finite; the message contains what.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise LayProgramError(f"{what} must be a number, got {_shown(value)}")
    try:
        number = float(value)
    except (ValueError, OverflowError):
        raise LayProgramError(f"{what} must be a number, got {_shown(value)}") from None
    if not math.isfinite(number):
        raise LayProgramError(f"{what} must be finite, got {number}")
    return number


def _marker_number(value: object, place: str) -> int:
    text = str(value).strip().removeprefix("P")
    if isinstance(value, bool) or not (text.isascii() and text.isdigit() and len(text) < 7):
        raise LayProgramError(
            f"{place}: marker must be a whole number from 1 on, got {_shown(value)}"
        )
    if int(text) < 1:
        raise LayProgramError(f"{place}: markers are numbered from 1 on, got {text}")
    return int(text)


def _one(known: tuple[str, ...], names: Collection[str], where: str) -> str:
    found = [name for name in known if name in names]
    if len(found) != 1:
        raise LayProgramError(
            f"{where} needs one of {', '.join(known)}, it has {', '.join(found) or 'none'}"
        )
    return found[0]


def _empty(value: object) -> bool:
    return value is None or (isinstance(value, str) and not value.strip())


def _shown(value: object) -> str:
    text = "nothing" if value is None else str(type(value).__name__)
    if isinstance(value, str):
        text = repr(value[:40])
    elif isinstance(value, bool | float):
        text = str(value)
    return text


def parse_csv(text: str, *, radius: float, name: str) -> LayProgram:
    """Read a table.

    Args:
        text: Head line and rows; lines that are empty or begin with # are skipped.
        radius: Of the laid cable's centreline [m].
        name: Of the program.

    Raises:
        LayProgramError: It cannot be used; the message contains the line.
    """
    points = PointList(radius=radius)
    columns: Columns | None = None
    head: list[str] = []
    reader = csv.reader(io.StringIO(text), strict=True)
    try:
        for cells in reader:
            if not any(cell.strip() for cell in cells) or cells[0].lstrip().startswith("#"):
                continue
            place = f"line {reader.line_num} of {name}"
            if columns is None:
                head = [cell.strip() for cell in cells]
                if len(head) == 1 and ";" in head[0]:
                    raise LayProgramError(f"{place} parts its columns with ;, commas are read")
                if len(set(head)) < len(head):
                    raise LayProgramError(f"{place} names a column twice: {', '.join(head)[:80]}")
                columns = Columns.of(head, place)
                continue
            if len(cells) != len(head):
                raise LayProgramError(
                    f"{place} has {len(cells)} cells, the head line has {len(head)}"
                )
            points.add_row(columns, dict(zip(head, cells, strict=True)), place)
    except csv.Error as error:
        raise LayProgramError(f"line {reader.line_num} of {name}: {error}") from error
    return points.program(name)
