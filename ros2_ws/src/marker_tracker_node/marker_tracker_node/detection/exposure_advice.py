"""Exposure, gain and light, judged by the pictures: how bright the paint is, noise, smear.

Grey levels are taken to be proportional to light: a camera that bends them (gamma) needs more
change than is advised, in the same direction.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from marker_tracker_node.arrays import ByteArray, FlagArray, FloatArray
from marker_tracker_node.camera.pinhole import PinholeCamera
from marker_tracker_node.detection.colour import CLIPPED_LEVEL, CLIPPED_SHARE, hsv, hue_difference
from winding_core.units import MILLISECOND

# Least saturation of paint, and least level of its brightest channel: below, noise has hues.
PAINT_SATURATION, PAINT_LEVEL = 0.35, 24.0
LEAST_PAINT = 50  # Fewer pixels of paint in all pictures show no level
# Paint as bright as this leaves room for a highlight, and is measured at half of it: recall 0.98
# of light x0.5 (test_robust_runs.py), where paint of 225 under full light has 112.
TARGET, DARKEST = 200.0, 100.0
MOST_NOISE = 8.0  # Noise that is measured with recall 0.98 (the same test) [grey levels]
MOST_SMEAR = 1.0  # Smear as wide as a pixel is no wider than the pixel makes an edge [px]
WORTH = 1.1  # Changes by less are not worth a sentence
# Of noise: levels that the sensor's ends do not cut, and the filter whose answer to a plane is
# nothing (Immerkaer, Computer Vision and Image Understanding 64, 1996), of gain 6.
INSIDE = (12, 243)
LAPLACIAN = np.array([[1.0, -2.0, 1.0], [-2.0, 4.0, -2.0], [1.0, -2.0, 1.0]])
LAPLACIAN_GAIN = 6.0
# Median of the absolute value of a normal variable, in standard deviations.
MEDIAN_OF_NORMAL = 0.6745
LEAST_PIXELS = 500


@dataclass(frozen=True, kw_only=True)
class PictureLevels:
    """What pictures show of light and noise."""

    pictures: int  # How many were looked at
    paint: float  # Level of paint that nine tenths of its pixels are below, 0 to 255; nan: no paint
    saturated: float  # Share of the paint's pixels with a channel at its end, 0 to 1
    noise: float  # One standard deviation of a pixel [grey levels]; nan where it cannot be measured


def picture_levels(
    frames: Iterable[ByteArray], hues: Sequence[float], tolerance: float
) -> PictureLevels:
    """Measure levels and noise of pictures.

    Paint is what has the hue of a marker and is not grey. Noise is that of green: the median
    answer of a filter to which planes give none, away from the sensor's ends. Every second row and
    column is looked at by itself: interpolated pixels of a mosaic show less noise than the sensor
    has. What a camera smooths, or JPEG does, cannot be seen.

    Args:
        frames: The pictures, blue-green-red, shape (rows, columns, 3) each.
        hues: Of the markers [deg].
        tolerance: How far a hue may lie from those [deg].
    """
    counts, clipped, count = np.zeros(256, dtype=np.int64), 0, 0
    noise = []
    for frame in frames:
        count += 1
        paint = frame[_paint(frame, hues, tolerance)].max(axis=1)
        counts += np.bincount(paint, minlength=256)
        clipped += int((paint >= CLIPPED_LEVEL).sum())
        parts = [frame[row::2, column::2, 1] for row in (0, 1) for column in (0, 1)]
        noise.append(max(map(_noise, parts)))
    total = int(counts.sum())
    known = [sigma for sigma in noise if math.isfinite(sigma)]
    enough = total >= LEAST_PAINT
    return PictureLevels(
        pictures=count,
        paint=float(np.searchsorted(np.cumsum(counts), 0.9 * total)) if enough else math.nan,
        saturated=clipped / total if enough else math.nan,
        noise=float(np.median(known)) if known else math.nan,
    )


def _paint(frame: ByteArray, hues: Sequence[float], tolerance: float) -> FlagArray:
    """Return which pixels have a marker's hue, shape (rows, columns)."""
    # Mean of nine: noise of a grey surface shows every hue.
    smooth = np.asarray(cv2.blur(frame, (3, 3)), dtype=np.uint8).reshape(-1, 3)
    hue, saturation, _ = hsv(smooth)
    near = np.zeros(hue.shape, dtype=bool)
    for wanted in hues:
        near |= np.abs(hue_difference(hue, wanted)) <= tolerance
    near &= (saturation >= PAINT_SATURATION) & (smooth.max(axis=1) >= PAINT_LEVEL)
    return near.reshape(frame.shape[:2])


def _noise(channel: ByteArray) -> float:
    level = channel[1:-1, 1:-1]
    answer = cv2.filter2D(channel.astype(np.float32), -1, LAPLACIAN)[1:-1, 1:-1]
    inside = (level >= INSIDE[0]) & (level <= INSIDE[1])
    if inside.sum() < LEAST_PIXELS:
        return math.nan
    median: FloatArray = np.median(np.abs(answer[inside]))
    return float(median) / (MEDIAN_OF_NORMAL * LAPLACIAN_GAIN)


def marker_speed(camera: PinholeCamera, distance: float, radius: float, turning: float) -> float:
    """Return how fast a marker that faces the camera passes its picture [px/s].

    Args:
        camera: Lens, window and binning.
        distance: Of the camera from the cylinder's axis [m].
        radius: Of the cable's outside about the axis [m].
        turning: Speed of the cylinder [rad/s].

    Raises:
        ValueError: The camera does not stand outside the cable.
    """
    if not distance > radius:
        raise ValueError(f"the camera must stand more than {radius:g} m off, got {distance:g} m")
    focal = camera.k[1, 1] / camera.binning
    return float(focal * abs(turning) * radius / (distance - radius))


@dataclass(frozen=True, kw_only=True)
class ExposureAdvice:
    """What pictures require of exposure, gain and light."""

    fault: bool  # Whether something has to be changed
    sentences: tuple[str, ...]  # One to three
    exposure: float = 1.0  # Factor on the exposure
    gain: float = 1.0  # Factor on gain or light, or on the exposure where that is not known


def exposure_advice(
    levels: PictureLevels, *, exposure: float = math.nan, speed: float = math.nan
) -> ExposureAdvice:
    """Return what to change, with numbers.

    The exposure is shortened until it neither smears markers nor brings paint to its end, and
    lengthened as far as it may where paint is dark. Gain or light make up for the rest; gain only
    while noise, which grows with it, stays low.

    Args:
        levels: Of the pictures.
        exposure: Of the camera [s]; nan where it is not known.
        speed: Of the fastest marker in the picture [px/s]; nan where it is not known.
    """
    if math.isnan(levels.paint):
        text = "no pixels have the markers' hue: hue, white balance or light are wrong"
        return ExposureAdvice(fault=True, sentences=(text,))
    longest = MOST_SMEAR / speed if speed > 0.0 else math.inf
    saturated, dark = levels.saturated > CLIPPED_SHARE, levels.paint < DARKEST
    # Of paint at its end only a bound is known.
    wanted = 0.5 if saturated else TARGET / max(levels.paint, 1.0) if dark else 1.0
    faults, changes = [], []
    of_exposure, of_gain, knobs = 1.0, wanted, "exposure, gain or light"
    if math.isfinite(exposure):
        of_exposure = min(wanted, longest / exposure)
        level = max(levels.paint, 1.0) * of_exposure
        of_gain, knobs = TARGET / level if level < DARKEST else 1.0, "gain or light"
        if exposure * speed > MOST_SMEAR:
            faults.append(
                f"exposure {exposure / MILLISECOND:.2g} ms smears markers by "
                f"{exposure * speed:.1f} px at {speed:.0f} px/s"
            )
    if saturated:
        faults.append(
            f"{levels.saturated:.0%} of the paint has a channel at its end, at most "
            f"{CLIPPED_SHARE:.0%} may"
        )
    if dark:
        faults.append(f"paint is at level {levels.paint:.0f} of 255, at least {DARKEST:.0f} needed")
    if max(of_exposure, 1.0 / of_exposure) > WORTH:
        how = "at most" if of_exposure < 1.0 else "up to"
        changes.append(f"expose {how} {exposure * of_exposure / MILLISECOND:.2g} ms")
    changes += _of_gain(of_gain, levels.noise, knobs)
    sentences = (*faults, *(["; ".join(changes)] if changes else []))
    if not sentences:
        return ExposureAdvice(fault=False, sentences=(_fitting(levels, exposure, longest),))
    return ExposureAdvice(fault=True, sentences=sentences, exposure=of_exposure, gain=of_gain)


def _of_gain(factor: float, noise: float, knobs: str) -> Iterator[str]:
    """Yield by how much gain or light have to change; noise decides which of them."""
    amplified = noise * factor
    if factor > WORTH:
        if amplified > MOST_NOISE:
            yield (
                f"raise the light by {factor:.2g}; by gain noise would be {amplified:.0f} grey "
                f"levels, at most {MOST_NOISE:.0f} may be"
            )
        else:
            yield f"raise {knobs} by {factor:.2g}"
    elif noise > WORTH * MOST_NOISE:
        yield (
            f"lower the gain by {noise / MOST_NOISE:.2g} and raise the light as much: noise is "
            f"{noise:.0f} grey levels, at most {MOST_NOISE:.0f} may be"
        )
    elif factor < 1.0 / WORTH:
        yield f"lower {knobs} by {1.0 / factor:.2g}"


def _fitting(levels: PictureLevels, exposure: float, longest: float) -> str:
    text = (
        f"exposure and gain fit: paint at level {levels.paint:.0f} of 255, "
        f"{levels.saturated:.0%} of it at its end, noise {levels.noise:.1f} grey levels"
    )
    if math.isinf(longest):
        return text
    if math.isnan(exposure):
        return f"{text}; expose at most {longest / MILLISECOND:.2g} ms"
    return f"{text}, smear {exposure * MOST_SMEAR / longest:.1f} px"
