"""Gates, in which marks are sought in a picture: their pixels, and what comes of looking."""

import math
from typing import NamedTuple

import numpy as np

from marker_tracker_node.arrays import ByteArray, FloatArray, IndexArray
from winding_core.compiling import called

# Places in `Picture.tables`; the colours of markers follow.
UNKNOWN, ANY, FIRST_COLOUR = range(3)
TABLE_SIZE = 32**3
# What comes of looking for a mark; COVERED where cable that is about to land or has landed later
# is before it, HIDDEN until it has been measured, PARTLY where light hides a part of it.
OUT_OF_SIGHT, COVERED, CLIPPED, HIDDEN, MEASURED, PARTLY = range(6)
NO_IDENTITY = -1  # Of a detector that cannot know which marker it measures


class Detection(NamedTuple):
    """What a detector reports of a mark in one frame.

    The tracker asks nothing else of what is painted on the cable: whatever returns this is a
    detector, see `detectors`.
    """

    outcome: int  # MEASURED, PARTLY, or HIDDEN with nan for azimuth and z
    azimuth: float  # Of the cable's centre line under the middle of the mark [rad]
    z: float  # The same [m]
    share: float  # Measured over expected area of the part that light does not hide
    azimuth_factor: float  # By how much the azimuth's deviation exceeds that of a mark seen whole
    z_factor: float  # The same of z; infinite where the picture shows nothing of it
    identity: int  # n of the marker Pn that the mark names; NO_IDENTITY where it names none


NOTHING = Detection(HIDDEN, math.nan, math.nan, 0.0, 1.0, 1.0, NO_IDENTITY)


class Picture(NamedTuple):
    """A frame and the colours that are sought in it."""

    pixels: ByteArray  # Blue-green-red, shape (rows, columns, 3)
    # One where a colour belongs to the marker that is sought, by 5 bits of each channel, shape
    # (32768,).
    table: ByteArray
    # The same of everything that is distinguished, one after the other, shape ((2 + colours)
    # 32768,): what light has made unknown, any colour of markers, each of them.
    tables: ByteArray
    colour_of: IndexArray  # Number of each marker's table, 2 or more, shape (markers,)


class Gates(NamedTuple):
    """Where bands are sought in a picture: every array has one place a gate.

    Across counts towards +z, to the right of a cable that runs up the image.
    """

    seen_a: FloatArray  # Plane coordinates of the centre, dimensionless
    seen_b: FloatArray
    column: FloatArray  # Of the centre [px]
    row: FloatArray  # Of the centre [px]
    along_u: FloatArray  # Column of the unit direction along the cable
    along_v: FloatArray  # Row of the unit direction along the cable
    ahead: FloatArray  # Length along the direction [px]
    behind: FloatArray  # Length against the direction [px]
    left: FloatArray  # Limit across the direction, negative [px]
    right: FloatArray  # Limit across the direction, positive [px]
    half_band: FloatArray  # Half length of the band alone [px]
    left_lean: FloatArray  # Change of the left limit along the cable [px/px]
    right_lean: FloatArray  # The same of the right limit


@called
def empty_gates(count: int) -> Gates:  # pragma: no cover
    """Return room for a number of gates."""
    r = np.zeros((13, count))
    return Gates(r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8], r[9], r[10], r[11], r[12])


@called
def table_index(blue: int, green: int, red: int) -> np.uint32:  # pragma: no cover
    """Return the place of a colour in `Picture.table`."""
    return (np.uint32(blue >> 3) << 10) | (np.uint32(green >> 3) << 5) | np.uint32(red >> 3)


@called
def several_colours(picture: Picture) -> bool:  # pragma: no cover
    """Return whether markers have different colours."""
    return picture.tables.size > (FIRST_COLOUR + 1) * TABLE_SIZE


@called
def seeking(picture: Picture, colour: int) -> Picture:  # pragma: no cover
    """Return a picture in which a colour is sought."""
    # A gate reads a table of its own faster than a part of a larger one.
    table = picture.tables[colour * TABLE_SIZE : (colour + 1) * TABLE_SIZE]
    return Picture(picture.pixels, table, picture.tables, picture.colour_of)


@called
def strip(
    slope: float, offset: float, low: float, high: float
) -> tuple[float, float]:  # pragma: no cover
    """Return between which x [pixels] a straight line slope x + offset stays within limits.

    A level line beyond them does so nowhere: then the first x lies behind the last.
    """
    if abs(slope) < 1.0e-9:
        return (-math.inf, math.inf) if low <= offset <= high else (1.0, -1.0)
    first, second = (low - offset) / slope, (high - offset) / slope
    return min(first, second), max(first, second)


@called
def gate_rows(picture: Picture, gates: Gates, n: int) -> tuple[int, int]:  # pragma: no cover
    """Return the first and the last row of the picture that gate n reaches."""
    tu, tv = abs(gates.along_u[n]), abs(gates.along_v[n])
    height = max(gates.ahead[n], gates.behind[n]) * tv + max(-gates.left[n], gates.right[n]) * tu
    last = picture.pixels.shape[0] - 1
    return max(math.ceil(gates.row[n] - height), 0), min(math.floor(gates.row[n] + height), last)


@called
def gate_moments(
    picture: Picture, gates: Gates, n: int
) -> tuple[float, float, float]:  # pragma: no cover
    """Return number and mean column and row of the marker pixels in gate n, parts of them too."""
    columns = picture.pixels.shape[1]
    column, row, tu, tv = gates.column[n], gates.row[n], gates.along_u[n], gates.along_v[n]
    ahead, behind, low, high = gates.ahead[n], gates.behind[n], gates.left[n], gates.right[n]
    low_lean, high_lean = gates.left_lean[n], gates.right_lean[n]
    # The sides are never level: a cable runs up the picture.
    low_slope, low_way = tu - low_lean * tv, -1.0 / (tv + low_lean * tu)
    high_slope, high_way = tu - high_lean * tv, -1.0 / (tv + high_lean * tu)
    top, bottom = gate_rows(picture, gates, n)
    count, sum_column, sum_row = 0.0, 0.0, 0.0
    for v in range(top, bottom + 1):
        dv = v - row
        left = (low - low_slope * dv) * low_way
        right = (high - high_slope * dv) * high_way
        near, far = strip(tu, tv * dv, -behind, ahead)
        start = max(min(left, right), near, -0.5 - column)
        end = min(max(left, right), far, columns - 0.5 - column)
        if end <= start:
            continue
        first, last = math.floor(column + start + 0.5), math.ceil(column + end - 0.5)
        # Indices into a part of the row are not asked whether they count from its end.
        line = picture.pixels[v, first : last + 1]
        hits, place, hit, others = 0, 0, 0, 0
        for u in range(line.shape[0]):
            hit = picture.table[table_index(line[u, 0], line[u, 1], line[u, 2])]
            hits += hit
            place += hit * u
            if u == 0:
                others = hit
        # Of the pixels on the gate's sides that part counts which lies within.
        out, beyond = column + start + 0.5 - first, last + 0.5 - column - end
        cover = hits - others * out - hit * beyond
        count += cover
        sum_column += place + cover * first + 0.5 * others * (1.0 - out) * out
        sum_column -= hit * beyond * (last - first + 0.5 * (1.0 - beyond))
        sum_row += cover * v
    if count <= 0.0:
        return 0.0, math.nan, math.nan
    return count, sum_column / count, sum_row / count


@called
def gate_columns(
    pixels: ByteArray, gates: Gates, n: int, dv: float
) -> tuple[int, int]:  # pragma: no cover
    """Return the first and the last column of gate n in the row `dv` below its centre.

    Its sides count as they are beside the centre, whatever their lean.
    """
    tu, tv, column = gates.along_u[n], gates.along_v[n], gates.column[n]
    left, right = strip(-tv, tu * dv, gates.left[n], gates.right[n])
    near, far = strip(tu, tv * dv, -gates.behind[n], gates.ahead[n])
    last = pixels.shape[1] - 1.0 - column
    return (
        math.ceil(column + max(left, near, -column)),
        math.floor(column + min(right, far, last)),
    )


@called
def gate_place(gates: Gates, n: int, u: float, v: float) -> tuple[float, float]:  # pragma: no cover
    """Return how far a pixel lies along gate n from its centre, and across it [px]."""
    du, dv = u - gates.column[n], v - gates.row[n]
    tu, tv = gates.along_u[n], gates.along_v[n]
    return du * tu + dv * tv, tu * dv - tv * du


@called
def in_gate(gates: Gates, n: int, u: float, v: float) -> bool:  # pragma: no cover
    """Return whether a pixel lies in gate n."""
    along, across = gate_place(gates, n, u, v)
    left = gates.left[n] + gates.left_lean[n] * along
    right = gates.right[n] + gates.right_lean[n] * along
    return bool(-gates.behind[n] <= along <= gates.ahead[n] and left <= across <= right)


@called
def gate_visibility(
    gates: Gates, n: int, margin: float, picture: Picture
) -> int:  # pragma: no cover
    """Return OUT_OF_SIGHT, CLIPPED or HIDDEN (nothing found) for a gate less its margin [px]."""
    rows, columns = picture.pixels.shape[:2]
    half = max(gates.ahead[n] - margin, gates.behind[n] - margin, 0.0)
    span = max(max(-gates.left[n], gates.right[n]) - margin, 0.0)
    tu, tv = abs(gates.along_u[n]), abs(gates.along_v[n])
    width, height = half * tu + span * tv, half * tv + span * tu
    # How far its middle lies within the nearer edges of the picture.
    column = min(gates.column[n] + 0.5, columns - 0.5 - gates.column[n])
    row = min(gates.row[n] + 0.5, rows - 0.5 - gates.row[n])
    if column < -width or row < -height:
        return OUT_OF_SIGHT
    return CLIPPED if column < width or row < height else HIDDEN
