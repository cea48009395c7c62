"""Renderer: a scene becomes the frame that the simulated camera delivers."""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from winding_rig_node.camera.cable_mesh import draw_cable
from winding_rig_node.camera.cable_section import Cable, Lighting
from winding_rig_node.camera.config import CameraConfig
from winding_rig_node.camera.cylinder_view import StaticView, static_view
from winding_rig_node.camera.dot_mesh import Dots, draw_dots
from winding_rig_node.camera.optics import lens_of, project_points
from winding_rig_node.camera.raster import BLOCK, LABEL, NEAR, Samples, resolve
from winding_rig_node.camera.scene import Paint, Scene, Surroundings
from winding_rig_node.camera.sensor import Noise, demosaiced, expose, falloff, noise_table

FloatArray = NDArray[np.float64]
SingleArray = NDArray[np.float32]
ByteArray = NDArray[np.uint8]

# Chords of this many pixels stay within 0.01 px of the arc at every radius of the paper.
SECTION_STEP = 3.0

GLOSS_SIZE = 2048  # Straight lines between so many values follow a highlight to 0.01 grey level

# Of one marker band: pixel (column, row) of its middle on the centre line, of the centroid of its
# visible surface, and the visible area [px]; nan where there is none.
BAND_DTYPE = np.dtype([("centre", "<f8", 2), ("centroid", "<f8", 2), ("area", "<f8")])
Bands = NDArray[np.void]


class Renderer:
    """Draw scenes into frames of one camera.

    A renderer keeps its sample buffers between frames: it belongs to one thread at a time, which
    may be any thread, and the drawing itself releases the interpreter lock.
    """

    def __init__(self, config: CameraConfig, surroundings: Surroundings | None = None) -> None:
        self.config = config
        self.surroundings = surroundings or Surroundings()
        rows, columns = config.window.shape
        s = config.supersampling
        self._lens = lens_of(config, s)
        self._light = _lighting(config)
        self._gloss = _gloss(config)
        self._falloff = falloff(config.window.shape, config.light.falloff)
        self._table = noise_table()
        blocks = rows, -(-columns // BLOCK)
        self._samples = Samples(
            seen=np.zeros((rows * s, columns * s, 4), dtype=np.float32),
            touched=np.zeros(blocks, dtype=np.uint8),
            shown=np.zeros(blocks, dtype=np.uint8),
            per_pixel=s,
        )
        self._radiance = np.zeros((rows, columns, 3), dtype=np.float32)
        self._drawn: StaticView | None = None
        self._views: dict[tuple[float, tuple[float, float], float, Paint], StaticView] = {}

    def render(self, scene: Scene, rng: np.random.Generator) -> ByteArray:
        """Return the frame of a scene, uint8 of shape (rows, columns, 3), blue-green-red."""
        config = self.config
        radiance = self.surroundings.cover(config, self._smeared(scene))
        if config.defocus > 0.0:
            radiance = cv2.GaussianBlur(radiance, (0, 0), config.defocus)
        gain = config.light.gain
        if config.light.flicker > 0.0:
            gain *= (1.0 + config.light.flicker) ** rng.uniform(-1.0, 1.0)
        rows, columns = config.window.shape
        frame = np.empty((rows, columns, 3), dtype=np.uint8)
        offsets = (rng.random(rows) * (self._table.size - 3 * columns)).astype(np.int64)
        noise = Noise(float(config.noise.read), float(config.noise.shot), self._table, offsets)
        flat = rows, 3 * columns
        expose(radiance.reshape(flat), self._falloff, float(gain), noise, frame.reshape(flat))
        return demosaiced(frame) if config.bayer else frame

    def visible_bands(self, scene: Scene) -> Bands:
        """Return the ground truth of every marker band as the sharp picture shows it.

        Rods of the surroundings do not hide anything here.
        """
        self._paint(scene)
        s = self.config.supersampling
        bands = np.zeros(scene.marker_theta.size, dtype=BAND_DTYPE)
        landed = np.isfinite(scene.marker_theta)
        bands["centre"] = np.nan
        bands["centre"][landed] = project_points(
            self.config, scene.centreline(scene.marker_theta[landed])
        )
        for n in range(bands.size):
            rows, columns = np.nonzero(self._samples.seen[..., LABEL] == n + 2)
            bands["area"][n] = rows.size / s**2
            if rows.size:
                middle = np.array([columns.mean(), rows.mean()])
                bands["centroid"][n] = (middle + 0.5) / s - 0.5
            else:
                bands["centroid"][n] = np.nan
        self._resolve(scene)
        return bands

    def _smeared(self, scene: Scene) -> SingleArray:
        """Return the mean radiance over the exposure, which the scene's instant halves."""
        config = self.config
        way = config.exposure * scene.cylinder_speed
        if way == 0.0 or config.exposure_samples == 1:
            return self._draw(scene)
        total = np.zeros_like(self._radiance)
        for k in range(config.exposure_samples):
            share = (k + 0.5) / config.exposure_samples - 0.5
            total += self._draw(replace(scene, cylinder_angle=scene.cylinder_angle + share * way))
        return np.asarray(total / np.float32(config.exposure_samples), dtype=np.float32)

    def _view(self, scene: Scene) -> StaticView:
        key = (scene.cylinder_radius, scene.cylinder_ends, scene.flange_height, scene.paint)
        if key not in self._views:
            self._views[key] = static_view(self.config, *key, self.surroundings)
        return self._views[key]

    def _draw(self, scene: Scene) -> SingleArray:
        self._paint(scene)
        return self._resolve(scene)

    def _paint(self, scene: Scene) -> None:
        view = self._view(scene)
        theta = np.ascontiguousarray(scene.marker_theta, dtype=float)
        if self._drawn is not view:
            self._samples.seen[..., NEAR] = view.inverse_depth
            self._samples.shown[:] = 0
            self._radiance[:] = view.radiance
            self._drawn = view
        draw_cable(
            self._lens,
            view.rays,
            self._light,
            self._gloss,
            self._cable(scene),
            scene.path.table,
            theta if scene.dot_size == 0.0 else np.full_like(theta, np.nan),
            self._samples,
        )
        if scene.dot_size > 0.0:
            torsion = np.zeros_like(theta) + scene.torsion
            draw_dots(
                self._lens,
                self._light,
                self._gloss,
                self._cable(scene),
                scene.path.table,
                Dots(theta, torsion, float(scene.dot_size)),
                self._samples,
            )

    def _resolve(self, scene: Scene) -> SingleArray:
        view = self._view(scene)
        markers = scene.paint.of_markers(max(scene.marker_theta.size, 1))
        colours = np.array([scene.paint.cable, *markers], dtype=np.float32)
        resolve(view.radiance, view.inverse_depth, colours, self._samples, self._radiance)
        return self._radiance

    def _cable(self, scene: Scene) -> Cable:
        return Cable(
            cylinder_radius=float(scene.cylinder_radius),
            cable_radius=float(scene.cable_radius),
            turned=float(scene.cylinder_angle),
            landing_z=scene.landing_z,
            landing_lift=scene.landing_lift,
            guide_z=float(scene.guide_z),
            free_length=float(scene.free_length),
            tail=float(scene.tail_angle),
            band_width=float(scene.band_width),
            step=self._section_step(scene),
        )

    def _section_step(self, scene: Scene) -> float:
        config = self.config
        pixel = config.window.binning * config.position[0] / config.focal
        return min(SECTION_STEP * pixel / scene.centreline_radius, 0.06)


def _lighting(config: CameraConfig) -> Lighting:
    light = config.light
    x, y, z = (np.array(light.direction) / np.linalg.norm(light.direction)).tolist()
    return Lighting(x=x, y=y, z=z, ambient=float(light.ambient))


def _gloss(config: CameraConfig) -> FloatArray:
    cosine = np.linspace(0.0, 1.0, GLOSS_SIZE)
    return np.asarray(config.light.highlight * cosine**config.light.gloss, dtype=float)
