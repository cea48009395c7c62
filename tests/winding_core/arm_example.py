"""The shipped example of an arm, with other values."""

import re
from pathlib import Path

import yaml

FOLDER = Path(__file__).parents[2] / "examples" / "arm"
EXAMPLE = FOLDER / "arm.yaml"


def arm_file(folder: Path, joint_speed: float | None = None, **sections: dict[str, object]) -> str:
    """Write the example with other values in some sections, and another largest joint speed."""
    content = yaml.safe_load(EXAMPLE.read_text())
    for name, values in sections.items():
        content[name] |= values
    description = (FOLDER / "six-axis.urdf").read_text()
    if joint_speed is not None:
        description = re.sub(r'velocity="[^"]*"', f'velocity="{joint_speed}"', description)
    (folder / "six-axis.urdf").write_text(description)
    file = folder / "arm.yaml"
    file.write_text(yaml.safe_dump(content))
    return str(file)
