"""Depth-buffered samples: facets written into them, and resolved into pixels.

Where every corner of a section lies farther down (or up) the picture than that of the section
before, the facets between the two are a ribbon: the line through the corners of one kind crosses
each row once, and a row of a facet lies between two such crossings. Elsewhere facets are pairs of
triangles.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from winding_core.compiling import called, compiled

FloatArray = NDArray[np.float64]
SingleArray = NDArray[np.float32]
ByteArray = NDArray[np.uint8]

# What a corner of a facet holds, and what a sample holds: its label in the place of the column.
COLUMN, NEAR, SHADE, GLOSS, ROW = 0, 1, 2, 3, 4
LABEL = 0

BLOCK = 8  # Frames are resolved in blocks of a row of this many pixels


class Point(NamedTuple):
    """A point of a facet: place on the sample grid, inverse depth [1/m], shade and gloss."""

    column: float
    near: float
    shade: float
    gloss: float
    row: float


class Samples(NamedTuple):
    """Buffers of the samples."""

    # Label, inverse depth (the cylinder's for no label), shade and gloss of what is seen, shape
    # (rows * per_pixel, columns * per_pixel, 4).
    seen: SingleArray
    touched: ByteArray  # One for each block of pixels that was drawn into, shape (rows, blocks)
    # One for each block of the radiance image that is not background, shape of touched.
    shown: ByteArray
    per_pixel: int  # Samples per pixel and direction


@called
def between(one: Point, other: Point, share: float) -> Point:  # pragma: no cover
    """Return the point at a share of the way from one to another."""
    return Point(
        one.column + share * (other.column - one.column),
        one.near + share * (other.near - one.near),
        one.shade + share * (other.shade - one.shade),
        one.gloss + share * (other.gloss - one.gloss),
        one.row + share * (other.row - one.row),
    )


@called
def touch(
    touched: ByteArray, row: int, first: int, last: int, per_pixel: int
) -> None:  # pragma: no cover
    """Note that samples of a row are drawn into, from a first to a last column."""
    for block in range(first // (per_pixel * BLOCK), last // (per_pixel * BLOCK) + 1):
        touched[row // per_pixel, block] = 1


@called
def fill_triangle(
    a: Point, b: Point, c: Point, value: int, seen: SingleArray
) -> None:  # pragma: no cover
    """Write the samples of a triangle where they lie before what is there."""
    top = max(math.ceil(min(a.row, b.row, c.row)), 0)
    bottom = min(math.floor(max(a.row, b.row, c.row)), seen.shape[0] - 1)
    left = max(math.ceil(min(a.column, b.column, c.column)), 0)
    right = min(math.floor(max(a.column, b.column, c.column)), seen.shape[1] - 1)
    b_column, b_row = b.column - a.column, b.row - a.row
    c_column, c_row = c.column - a.column, c.row - a.row
    area = b_column * c_row - b_row * c_column
    if top > bottom or left > right or area == 0.0:
        return
    scale = 1.0 / area
    for row in range(top, bottom + 1):
        for column in range(left, right + 1):
            x, y = column - a.column, row - a.row
            v, w = (x * c_row - y * c_column) * scale, (y * b_column - x * b_row) * scale
            u = 1.0 - v - w
            if u >= 0.0 and v >= 0.0 and w >= 0.0:
                near = u * a.near + v * b.near + w * c.near
                if near > seen[row, column, NEAR]:
                    seen[row, column, LABEL] = value
                    seen[row, column, NEAR] = near
                    seen[row, column, SHADE] = u * a.shade + v * b.shade + w * c.shade
                    seen[row, column, GLOSS] = u * a.gloss + v * b.gloss + w * c.gloss


@compiled
def resolve(
    background: SingleArray,
    behind: SingleArray,
    colours: SingleArray,
    samples: Samples,
    out: SingleArray,
) -> None:  # pragma: no cover
    """Bring a radiance image up to what was drawn and clear the samples for the next frame.

    Args:
        background: Radiance without the cable, shape (rows, columns, 3).
        behind: Inverse depth of the cylinder at each sample [1/m].
        colours: Reflectance of the cable and of each marker, shape (1 + markers, 3).
        samples: What was drawn.
        out: Radiance, shape (rows, columns, 3), as the last call left it.
    """
    rows, columns = background.shape[:2]
    seen, touched, shown, size = samples.seen, samples.touched, samples.shown, samples.per_pixel
    nothing, one, glare = np.float32(0.0), np.float32(1.0), np.float32(255.0)
    share = np.float32(1.0 / (size * size))
    for row in range(rows):
        for block in range(touched.shape[1]):
            drawn = touched[row, block]
            if not (drawn or shown[row, block]):
                continue
            touched[row, block] = 0
            shown[row, block] = drawn
            for column in range(block * BLOCK, min((block + 1) * BLOCK, columns)):
                hits, cable, marker, white = nothing, nothing, nothing, nothing
                which = one
                if drawn:
                    for j in range(row * size, (row + 1) * size):
                        for i in range(column * size, (column + 1) * size):
                            label, shade = seen[j, i, LABEL], seen[j, i, SHADE]
                            hits += min(label, one)
                            cable += shade if label == one else nothing
                            marker += shade if label > one else nothing
                            which = max(which, label)
                            white += seen[j, i, GLOSS]
                            seen[j, i, LABEL] = nothing
                            seen[j, i, NEAR] = behind[j, i]
                            seen[j, i, SHADE] = nothing
                            seen[j, i, GLOSS] = nothing
                # Markers of two colours share next to no pixel: the later one's is taken.
                paint = int(which) - 1
                rest = one - hits * share
                for channel in range(3):
                    light = colours[0, channel] * cable + colours[paint, channel] * marker
                    mean = (light + glare * white) * share
                    out[row, column, channel] = mean + rest * background[row, column, channel]


BEGIN = 0  # Index among sections of the one that a ribbon begins with


@called
def point(rims: FloatArray, which: int, m: int) -> Point:  # pragma: no cover
    """Return corner m of one of some sections."""
    return _point_of(rims, which, m, rims[which, m, ROW])


@called
def _point_of(table: FloatArray, which: int, m: int, row: float) -> Point:  # pragma: no cover
    """Return what is kept of corner m of a section, or of its line at a crossing, with its row."""
    return Point(
        table[which, m, COLUMN],
        table[which, m, NEAR],
        table[which, m, SHADE],
        table[which, m, GLOSS],
        row,
    )


@called
def begin(rims: FloatArray, which: int) -> None:  # pragma: no cover
    """Keep a section as the one that a ribbon begins with."""
    for m in range(rims.shape[1]):
        for j in range(rims.shape[2]):
            rims[BEGIN, m, j] = rims[which, m, j]


@called
def direction(rims: FloatArray, one: int, other: int) -> int:  # pragma: no cover
    """Return 1 if a section lies below another at every corner, -1 if above, 0 if neither."""
    down, up = True, True
    for m in range(rims.shape[1]):
        rise = rims[other, m, ROW] - rims[one, m, ROW]
        down, up = down and rise > 0.0, up and rise < 0.0
    return int(down) - int(up)


@called
def extend(
    crossings: FloatArray, rims: FloatArray, one: int, other: int
) -> None:  # pragma: no cover
    """Continue a ribbon from one section to another.

    Args:
        crossings: Where the line through each corner crosses each row of samples, written,
            shape (rows, corners, 4).
        rims: Sections, shape (sections, corners, 5).
        one: Index of a section.
        other: Index of the next section.
    """
    for m in range(rims.shape[1]):
        start, end = point(rims, one, m), point(rims, other, m)
        first = max(math.ceil(min(start.row, end.row)), 0)
        last = min(math.floor(max(start.row, end.row)), crossings.shape[0] - 1)
        scale = 1.0 / (end.row - start.row)
        for row in range(first, last + 1):
            place = between(start, end, (row - start.row) * scale)
            crossings[row, m, COLUMN] = place.column
            crossings[row, m, NEAR] = place.near
            crossings[row, m, SHADE] = place.shade
            crossings[row, m, GLOSS] = place.gloss


@called
def draw_ribbon(
    crossings: FloatArray, rims: FloatArray, end: int, value: int, samples: Samples
) -> None:  # pragma: no cover
    """Draw the facets of a ribbon with a label.

    Args:
        crossings: See `extend`.
        rims: Sections, shape (sections, corners, 5).
        end: Index of the section that the ribbon ends with.
        value: Label.
        samples: To be written.
    """
    seen, touched, per_pixel = samples.seen, samples.touched, samples.per_pixel
    rows, columns = seen.shape[:2]
    label = np.float32(value)
    upper, lower = BEGIN, end
    if rims[upper, 0, ROW] > rims[lower, 0, ROW]:
        upper, lower = end, BEGIN
    top, bottom = math.inf, -math.inf
    for m in range(rims.shape[1]):
        top, bottom = min(top, rims[upper, m, ROW]), max(bottom, rims[lower, m, ROW])
    for row in range(max(math.ceil(top), 0), min(math.floor(bottom), rows - 1) + 1):
        left, right = columns, -1
        for m in range(rims.shape[1] - 1):
            upper_a, upper_b = rims[upper, m, ROW], rims[upper, m + 1, ROW]
            lower_a, lower_b = rims[lower, m, ROW], rims[lower, m + 1, ROW]
            if row < min(upper_a, upper_b) or row > max(lower_a, lower_b):
                continue
            if upper_a <= row <= lower_a:
                a = _point_of(crossings, row, m, float(row))
            else:
                a = _cut(rims, upper if row < upper_a else lower, m, row)
            if upper_b <= row <= lower_b:
                b = _point_of(crossings, row, m + 1, float(row))
            else:
                b = _cut(rims, upper if row < upper_b else lower, m, row)
            if a.column > b.column:
                a, b = b, a
            # The span is written here: as a call it would cost as much again.
            first = math.ceil(max(a.column, 0.0))
            last = math.floor(min(b.column, columns - 1.0))
            if first > last:
                continue
            left, right = min(left, first), max(right, last)
            width = b.column - a.column
            scale = 1.0 / width if width > 0.0 else 0.0
            way = first - a.column
            near_rise, shade_rise = (b.near - a.near) * scale, (b.shade - a.shade) * scale
            gloss_rise = (b.gloss - a.gloss) * scale
            near, near_step = np.float32(a.near + way * near_rise), np.float32(near_rise)
            shade, shade_step = np.float32(a.shade + way * shade_rise), np.float32(shade_rise)
            gloss, gloss_step = np.float32(a.gloss + way * gloss_rise), np.float32(gloss_rise)
            for column in range(first, last + 1):
                if near > seen[row, column, NEAR]:
                    seen[row, column, LABEL] = label
                    seen[row, column, NEAR] = near
                    seen[row, column, SHADE] = shade
                    seen[row, column, GLOSS] = gloss
                near += near_step
                shade += shade_step
                gloss += gloss_step
        if left <= right:
            touch(touched, row, left, right, per_pixel)


@called
def _cut(rims: FloatArray, end: int, m: int, row: int) -> Point:  # pragma: no cover
    """Return where a row cuts the side of facet m at an end of the ribbon."""
    one, other = point(rims, end, m), point(rims, end, m + 1)
    return between(one, other, (row - one.row) / (other.row - one.row))


@called
def draw_triangles(
    rims: FloatArray, one: int, other: int, value: int, samples: Samples
) -> None:  # pragma: no cover
    """Draw the facets between two sections with a label, wherever their corners lie."""
    seen, touched, per_pixel = samples.seen, samples.touched, samples.per_pixel
    rows, columns = seen.shape[:2]
    left, right, top, bottom = math.inf, -math.inf, math.inf, -math.inf
    for m in range(rims.shape[1]):
        for which in (one, other):
            left, right = min(left, rims[which, m, COLUMN]), max(right, rims[which, m, COLUMN])
            top, bottom = min(top, rims[which, m, ROW]), max(bottom, rims[which, m, ROW])
    if left >= columns or right < 0.0 or top >= rows or bottom < 0.0:
        return
    first, last = math.floor(max(left, 0.0)), math.floor(min(right, columns - 1.0))
    for row in range(math.floor(max(top, 0.0)), math.floor(min(bottom, rows - 1.0)) + 1):
        touch(touched, row, first, last, per_pixel)
    for m in range(rims.shape[1] - 1):
        a, b = point(rims, one, m), point(rims, one, m + 1)
        c, d = point(rims, other, m), point(rims, other, m + 1)
        fill_triangle(a, b, c, value, seen)
        fill_triangle(c, b, d, value, seen)
