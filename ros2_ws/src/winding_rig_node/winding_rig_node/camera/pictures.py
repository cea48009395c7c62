"""How frames leave the camera: as a compressed preview, and as a sequence on disk with truth."""

import csv
from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

from winding_rig_node.camera.config import CameraCalibration
from winding_rig_node.camera.renderer import Renderer
from winding_rig_node.camera.scene import Scene


def encode_jpeg(frame: NDArray[np.uint8], quality: int = 80, shrink: int = 1) -> bytes:
    """Return a frame as JPEG.

    Args:
        frame: Blue-green-red, shape (rows, columns, 3).
        quality: 1 to 100.
        shrink: Whole factor by which both sides are reduced first.

    Raises:
        ValueError: The quality or the factor is out of its range.
    """
    if not 1 <= quality <= 100:
        raise ValueError(f"quality must lie in 1 to 100, got {quality}")
    if shrink < 1:
        raise ValueError(f"shrink must be at least 1, got {shrink}")
    if shrink > 1:
        size = (frame.shape[1] // shrink, frame.shape[0] // shrink)
        frame = np.asarray(cv2.resize(frame, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    done, data = cv2.imencode(".jpg", frame, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise ValueError(f"a frame of shape {frame.shape} cannot be encoded as JPEG")
    return bytes(data)


def write_sequence(
    folder: Path,
    renderer: Renderer,
    instants: Iterable[tuple[float, Scene]],
    rng: np.random.Generator,
) -> int:
    """Render instants into a folder and return how many frames it holds.

    Writes frame_000000.png and so on, frames.csv (file, t), motion.csv (t, cylinder_angle,
    guide_z), truth.csv (t, id, theta, z, column, row, area) and camera.yaml.

    Raises:
        OSError: A picture cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    count = 0
    with (
        (folder / "frames.csv").open("w", encoding="utf-8", newline="") as frames_file,
        (folder / "motion.csv").open("w", encoding="utf-8", newline="") as motion_file,
        (folder / "truth.csv").open("w", encoding="utf-8", newline="") as truth_file,
    ):
        frames, motion, truth = (csv.writer(f) for f in (frames_file, motion_file, truth_file))
        frames.writerow(["file", "t"])
        motion.writerow(["t", "cylinder_angle", "guide_z"])
        truth.writerow(["t", "id", "theta", "z", "column", "row", "area"])
        for t, scene in instants:
            name = f"frame_{count:06d}.png"
            if not cv2.imwrite(str(folder / name), renderer.render(scene, rng)):
                raise OSError(f"cannot write {folder / name}")
            frames.writerow([name, f"{t:.9f}"])
            motion.writerow([f"{t:.9f}", f"{scene.cylinder_angle:.12g}", f"{scene.guide_z:.12g}"])
            height = scene.path.height(scene.marker_theta)
            for n, band in enumerate(renderer.visible_bands(scene)):
                numbers = [scene.marker_theta[n], height[n], *band["centroid"], band["area"]]
                truth.writerow([f"{t:.9f}", n, *(f"{value:.9g}" for value in numbers)])
            count += 1
    _write_camera(folder / "camera.yaml", renderer.config.calibration())
    return count


def _write_camera(path: Path, camera: CameraCalibration) -> None:
    content = {
        "image_width": camera.width,
        "image_height": camera.height,
        "camera_name": "simulated",
        "camera_matrix": _matrix(camera.k),
        "distortion_model": camera.distortion_model,
        "distortion_coefficients": _matrix(camera.d[None]),
        "rectification_matrix": _matrix(np.eye(3)),
        "projection_matrix": _matrix(np.column_stack([camera.k, np.zeros(3)])),
        "roi": dict(zip(("x_offset", "y_offset", "width", "height"), camera.roi, strict=True)),
        "binning": camera.binning,
    }
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")


def _matrix(values: NDArray[np.float64]) -> dict[str, object]:
    return {
        "rows": values.shape[0],
        "cols": values.shape[1],
        "data": [float(value) for value in values.ravel()],
    }
