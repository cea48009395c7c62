"""Draw the pictures of docs/gallery.md: run every example as its reader would.

`python docs/images/draw_gallery.py` in an environment with `winding`; takes about three minutes and
a gigabyte of temporary files.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

IMAGES = Path(__file__).parent
EXAMPLES = IMAGES.parents[1] / "examples" / "gallery"
LARGEST, QUALITY = 100_000, 92
# What the examples need: a film and a recording.
SOURCES = (
    "render film --case 8 --fps 50 --duration-s 5.5",
    "run --case 4 --speed 0 --output run --bag run/bag",
)
ARGUMENTS = {
    "predict_lay": (),
    "track_film": ("film",),
    "read_bag": ("run/bag",),
    "sweep_weight": (),
    "own_laws": (),
}


def main() -> None:
    """Make the sources, run the examples, and keep their pictures beside this file."""
    with tempfile.TemporaryDirectory() as place:
        for source in SOURCES:
            _python("-m", "winding_cli.cli", *source.split(), folder=place)
        for name, arguments in ARGUMENTS.items():
            _python(str(EXAMPLES / f"{name}.py"), *arguments, folder=place)
            _keep(Path(place, f"{name}.png"), IMAGES / f"gallery-{name.replace('_', '-')}.webp")


def _keep(drawn: Path, target: Path) -> None:
    with Image.open(drawn) as picture:
        picture.convert("RGB").save(target, quality=QUALITY, method=6)
    if target.stat().st_size > LARGEST:
        sys.exit(f"{target.name} has {target.stat().st_size} bytes, at most {LARGEST}")


def _python(*arguments: str, folder: str) -> None:
    subprocess.run([sys.executable, *arguments], cwd=folder, check=True)


if __name__ == "__main__":
    main()
