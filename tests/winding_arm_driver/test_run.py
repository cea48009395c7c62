"""`winding run` with a guide that goes along and across the axis, as the driver reports it."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.winding_config import WindingConfig
from processes import in_namespace, running
from winding_core.cable.cases import paper_case
from winding_core.machine.drive import DriveProfile
from winding_core.machine.readings import GuidePlace
from winding_recorder.bags.tables import topic_rows

pytestmark = [pytest.mark.processes, pytest.mark.timeout(600)]

CASE = paper_case(4)
# Pull of the example's load cell [N]; P1 has landed after so many seconds of the run.
TENSION, DURATION = 1.96, 5.0
FREE, LONGER, GROWN = 0.198, 0.3, 6.0
GANTRY = f"""<robot name="gantry"><link name="floor"/><link name="bridge"/><link name="arm"/>
<link name="eye"/>
<joint name="along" type="prismatic"><parent link="floor"/><child link="bridge"/>
<axis xyz="0 0 1"/><limit lower="-1" upper="2" velocity="1" effort="1"/></joint>
<joint name="lift" type="prismatic"><parent link="bridge"/><child link="arm"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<joint name="out" type="fixed"><parent link="arm"/><child link="eye"/>
<origin xyz="{CASE.centreline_radius} 0 0"/></joint></robot>"""
# The example driver as a cell of its own: 125 Hz, other topics, joints in another order.
CELL = {
    '"rig/joint_states"': '"cell/states"',
    '"cylinder_joint", "carriage_joint"': '"along", "table", "lift"',
    "[self.angle, self.carriage]": (
        f"[self.carriage, self.angle, -{FREE} * (1 + {LONGER} * min(self.angle / {GROWN}, 1))]"
    ),
    "            state.velocity = [self.share * OMEGA, feed]\n": "",
    "PERIOD, OMEGA, FEED = 0.002": "PERIOD, OMEGA, FEED = 0.008",
}

# The same cell, whose gantry goes where it is commanded to by joint positions.
LED_CELL = CELL | {
    "from std_srvs.srv import Trigger": (
        "from std_msgs.msg import Float64MultiArray\nfrom std_srvs.srv import Trigger"
    ),
    '(JointState, "rig/joint_targets"': '(Float64MultiArray, "arm/command"',
    """        now, stamp = self.get_clock().now(), Time.from_msg(message.header.stamp)
        age = 1.0e-9 * (now - stamp).nanoseconds if stamp.nanoseconds else 0.0
        if not self.goal or abs(age) > DEAD_MAN or "carriage_joint" not in message.name:
            return  # only between start and stop, and only in time
        at = message.name.index("carriage_joint")
        self.target, self.looks = (now, message.position[at], message.velocity[at]), 0
""": "        self.target, self.looks = (self.get_clock().now(), message.data[0], 0.0), 0\n",
}
MAPPING = {
    "cylinder": {"topic": "cell/states", "joint": "table"},
    "guide": {
        "source": "joints",
        "topic": "cell/states",
        "urdf": "gantry.urdf",
        "base": "floor",
        "tip": "eye",
    },
}


def arm_driver(folder: Path, namespace: str, **sections: object) -> Any:
    """Run the driver with a mapping of the gantry in a folder."""
    (folder / "gantry.urdf").write_text(GANTRY)
    file = folder / "arm.yaml"
    file.write_text(yaml.safe_dump(MAPPING | sections))
    words = ("-m", "winding_arm_driver", "--mapping", file, *in_namespace(namespace))
    return running(*words, ready="ready", cwd=folder)


@pytest.mark.campaign
@pytest.mark.parametrize("driver", [LED_CELL], indirect=True)
def test_driver_conforms_and_takes_targets(driver: Any, tmp_path: Path, command: Any) -> None:
    with arm_driver(tmp_path, driver.namespace, commands={"type": "positions"}):
        words = ("conform", "--no-camera", "--move", "--namespace", driver.namespace)
        command(*words, cwd=tmp_path, code=0)


@pytest.mark.parametrize("driver", [CELL], indirect=True)
def test_span_that_grows_is_predicted_as_it_is(driver: Any, tmp_path: Path, command: Any) -> None:
    with arm_driver(tmp_path, driver.namespace):
        command(
            *("run", "--case", 4, "--machine", "external", "--no-camera"),
            *("--namespace", driver.namespace, "--duration-s", DURATION),
            *("--output", tmp_path / "run", "--bag", tmp_path / "run" / "bag"),
            cwd=tmp_path, code=0,
        )  # fmt: skip
    marker = topic_rows(tmp_path / "run" / "bag", "fem/markers")[-1][1]
    wanted, steady = predicted(LONGER), predicted(0.0)
    length = math.hypot(CASE.centreline_radius * marker["theta"], marker["z"])
    # The specification's bar for a span whose true path is known.
    assert length == pytest.approx(wanted[0], rel=3.0e-3)
    # Readings are 8 ms apart and begin within one of the first motion [m].
    assert marker["z"] == pytest.approx(wanted[1], abs=5.0e-5)
    assert abs(steady[1] - wanted[1]) > 2.0e-4


def predicted(longer: float) -> tuple[float, float]:
    """Return length and z [m] of P1 by the rod that is given the true path."""
    model, drive = RodWinding(WindingConfig(case=CASE)), DriveProfile()
    for k in range(round(DURATION / 0.002) + 1):
        t = 0.002 * k
        reading = drive.reading_at(t)
        span = FREE * (1.0 + longer * min(reading.cylinder_angle / GROWN, 1.0))
        guide = GuidePlace.beside(CASE.centreline_radius, span)
        model.advance_to(t, replace(reading, guide=guide), TENSION)
    theta, z = (float(model.markers()[name][1]) for name in ("theta", "z"))
    return math.hypot(CASE.centreline_radius * theta, z), z
