"""What never moves in the picture: cylinder with its flanges, and backdrop."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from winding_rig_node.camera.config import CameraConfig
from winding_rig_node.camera.optics import RayRange, sample_rays
from winding_rig_node.camera.scene import Paint, Surroundings

FloatArray = NDArray[np.float64]
SingleArray = NDArray[np.float32]

_FLANGE = 3.0e-3  # Thickness of a flange [m]


@dataclass(frozen=True, kw_only=True)
class StaticView:
    """The still part of the picture of one cylinder."""

    # Of the cylinder, or a flange before it, at each sample [1/m], zero beside it, shape (rows * s,
    # columns * s).
    inverse_depth: SingleArray
    radiance: SingleArray  # Mean of each pixel without the cable, shape (rows, columns, 3)
    rays: RayRange  # Through the window


def static_view(
    config: CameraConfig,
    radius: float,
    ends: tuple[float, float],
    flange: float,
    paint: Paint,
    surroundings: Surroundings,
) -> StaticView:
    """Cast a ray through every sample at the cylinder and what stands behind it.

    Args:
        config: The camera.
        radius: Of the cylinder [m].
        ends: Axial ends of the cylinder [m].
        flange: Height of the flanges beyond its ends [m]; 0 for none.
        paint: Colours.
        surroundings: What stands behind.
    """
    rows, columns = config.window.shape
    s = config.supersampling
    inverse = np.zeros((rows * s, columns * s), dtype=np.float32)
    radiance = np.zeros((rows, columns, 3), dtype=np.float32)
    plain = np.empty_like(radiance)
    plain[:] = paint.backdrop
    backdrop = surroundings.behind(config, plain)
    ranges: list[tuple[float, ...]] = []
    for top in range(0, rows, 64):
        bottom = min(top + 64, rows)
        part = slice(top * s, bottom * s)
        rays = sample_rays(config, top, bottom)
        ranges.append(_extremes(rays))
        depth, normal, along = _cylinder_hit(config, rays, radius, ends)
        if flange > 0.0:
            for hit in _flange_hits(config, rays, radius + flange, ends):
                nearer = hit[0] < np.where(np.isnan(depth), np.inf, depth)
                depth[nearer], normal[nearer], along[nearer] = (part[nearer] for part in hit)
        colour = _cylinder_colour(config, normal, along, paint)
        beside = np.isnan(depth)
        colour[beside] = 0.0
        inverse[part] = np.where(beside, 0.0, 1.0 / depth)
        blocks = colour.reshape(-1, s, columns, s, 3).mean(axis=(1, 3))
        open_share = beside.reshape(-1, s, columns, s).mean(axis=(1, 3))
        radiance[top:bottom] = blocks + open_share[..., None] * backdrop[top:bottom]
    return StaticView(inverse_depth=inverse, radiance=radiance, rays=_merged(ranges))


def _extremes(rays: FloatArray) -> tuple[float, ...]:
    """Return y_low, -y_high, z_low, -z_high of a `RayRange`."""
    if not (rays[..., 0] < 0.0).all():
        return (-math.inf,) * 4
    y, z = rays[..., 1] / rays[..., 0], rays[..., 2] / rays[..., 0]
    return float(y.min()), float(-y.max()), float(z.min()), float(-z.max())


def _merged(parts: list[tuple[float, ...]]) -> RayRange:
    y_low, y_high, z_low, z_high = (min(column) for column in zip(*parts, strict=True))
    return RayRange(y_low=y_low, y_high=-y_high, z_low=z_low, z_high=-z_high)


def _cylinder_hit(
    config: CameraConfig, rays: FloatArray, radius: float, ends: tuple[float, float]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    x, y, z = config.position
    a = rays[..., 0] ** 2 + rays[..., 1] ** 2
    half = x * rays[..., 0] + y * rays[..., 1]
    room = half**2 - a * (x * x + y * y - radius**2)
    with np.errstate(invalid="ignore"):
        depth = (-half - np.sqrt(room)) / a
    along = z + depth * rays[..., 2]
    outside = ~((along > ends[0]) & (along < ends[1]) & (depth > 0.0))
    depth[outside] = np.nan
    normal = np.stack([x + depth * rays[..., 0], y + depth * rays[..., 1]], axis=-1) / radius
    return depth, normal, along


def _flange_hits(
    config: CameraConfig, rays: FloatArray, radius: float, ends: tuple[float, float]
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Yield where rays hit the rims and the faces of flanges, as `_cylinder_hit`."""
    for inner, outer in zip(ends, (ends[0] - _FLANGE, ends[1] + _FLANGE), strict=True):
        yield _cylinder_hit(config, rays, radius, (min(inner, outer), max(inner, outer)))
        for face in (inner, outer):
            with np.errstate(divide="ignore"):
                depth = (face - config.position[2]) / rays[..., 2]
            x, y = (config.position[i] + depth * rays[..., i] for i in (0, 1))
            depth = np.where((depth > 0.0) & (x * x + y * y < radius**2), depth, np.nan)
            # A face is lit by what comes from everywhere alone.
            yield depth, np.zeros((*depth.shape, 2)), np.full_like(depth, face)


def _cylinder_colour(
    config: CameraConfig, normal: FloatArray, along: FloatArray, paint: Paint
) -> FloatArray:
    """Turned metal: diffuse light with fine grooves around the circumference."""
    light = config.light
    lamp = np.array(light.direction) / np.linalg.norm(light.direction)
    diffuse = np.maximum(normal[..., 0] * lamp[0] + normal[..., 1] * lamp[1], 0.0)
    grooves = 1.0 + 0.03 * np.sin(along * 9.0e3) + 0.03 * np.sin(along * 2.3e3 + 1.0)
    shade = (light.ambient + (1.0 - light.ambient) * diffuse) * grooves
    return np.asarray(shade[..., None] * np.array(paint.cylinder), dtype=float)
