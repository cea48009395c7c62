"""An arm of the tests by its Denavit-Hartenberg numbers, and the mapping of its machine."""

import math
from pathlib import Path

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from winding_core.arm.arm_file import ArmMapping, read_mapping
from winding_core.arm.rigid import FloatArray

# Links d [m], a [m], alpha [rad] of a common six-axis arm.
LINKS = (
    (0.1625, 0.0, 0.5 * math.pi),
    (0.0, -0.425, 0.0),
    (0.0, -0.3922, 0.0),
    (0.1333, 0.0, 0.5 * math.pi),
    (0.0997, 0.0, -0.5 * math.pi),
    (0.0996, 0.0, 0.0),
)
NAMES = ("pan", "lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
DEAD_TIME = 0.015  # [s]
# A pose away from singularities, and where the machine's axis stands seen from the base.
HOME = np.array([0.3, -1.9, 1.8, -1.4, -1.4, 0.4])
EYE = [0.0, 0.02, 0.11]
TURN = [-1.5, 0.1, 0.2]  # The machine's axis lies nearly along the base's y, a little askew


def written(folder: Path, *, speed: float = 3.14, travel: float = 2.0 * math.pi) -> Path:
    parts = ['<robot name="arm">', '<link name="base_link"/>']
    parent, origin = "base_link", ("0 0 0", "0 0 0")
    for name, (d, a, alpha) in zip(NAMES, LINKS, strict=True):
        parts.append(f'<link name="{name}_link"/>')
        parts.append(
            f'<joint name="{name}" type="revolute"><parent link="{parent}"/>'
            f'<child link="{name}_link"/><origin xyz="{origin[0]}" rpy="{origin[1]}"/>'
            f'<axis xyz="0 0 1"/>'
            f'<limit lower="{-travel}" upper="{travel}" velocity="{speed}" effort="100"/></joint>'
        )
        parent, origin = f"{name}_link", (f"{a} 0 {d}", f"{alpha} 0 0")
    parts.append('<link name="tool0"/>')
    parts.append(
        f'<joint name="flange" type="fixed"><parent link="{parent}"/><child link="tool0"/>'
        f'<origin xyz="{origin[0]}" rpy="{origin[1]}"/></joint></robot>'
    )
    file = folder / "arm.urdf"
    file.write_text("\n".join(parts))
    return file


def tool(q: FloatArray) -> FloatArray:
    """Return the tool in the base by the Denavit-Hartenberg numbers alone, shape (4, 4)."""
    placed = np.eye(4)
    for angle, (d, a, alpha) in zip(q, LINKS, strict=True):
        c, s, ca, sa = math.cos(angle), math.sin(angle), math.cos(alpha), math.sin(alpha)
        placed = placed @ np.array(
            [
                [c, -s * ca, s * sa, a * c],
                [s, c * ca, -c * sa, a * s],
                [0.0, sa, ca, d],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )
    return placed


def mapping_text(folder: Path, joint_speed: float = 3.14, **commands: object) -> str:
    """Return a mapping whose winder_axis has the eye at home at (0.02, -0.2, 0.0) m of it."""
    placed = tool(HOME)
    eye = placed[:3, :3] @ EYE + placed[:3, 3]
    turn = Rotation.from_euler("xyz", TURN).as_matrix()
    origin = eye - turn @ [0.02, -0.2, 0.0]
    return yaml.safe_dump(
        {
            "cylinder": {"topic": "cell/encoder", "joint": "table", "scale": math.pi / 180.0},
            "guide": {
                "source": "joints",
                "topic": "arm/states",
                "urdf": written(folder, speed=joint_speed).name,
                "base": "base_link",
                "tip": "tool0",
                "eye_m": EYE,
            },
            "winder_axis": {"position_m": origin.tolist(), "rotation_rpy_rad": TURN},
            "commands": {"topic": "arm/command", **commands},
        }
    )


def mapping_of(folder: Path, source: str, kind: str) -> ArmMapping:
    """Write mapping.yaml with a source of the guide and a type of commands; return it."""
    values = yaml.safe_load(mapping_text(folder, type=kind, ahead_s=DEAD_TIME))
    values["guide"]["source"] = source
    file = folder / "mapping.yaml"
    file.write_text(yaml.safe_dump(values))
    return read_mapping(file)
