"""The report of a recorded run: a real bag in, a page and numbers out."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from axis_readings import axis_reading

from winding_cli.commands.bag import write_recorded_report
from winding_cli.run.delivery import flaw
from winding_cli.run.record import run_record
from winding_core.cable.condition import Condition
from winding_core.lay.records import LAY_CONTROL_DTYPE, LAY_DTYPE, ControlMode
from winding_core.machine.drive import DriveProfile
from winding_core.run_options import OperatorLimits
from winding_core.run_outcome import Ending, Extent
from winding_recorder.bags.description import (
    COMPLETE,
    PARAMETERS,
    YES,
    BagError,
    StoredMessage,
    jazzy_channel,
)
from winding_recorder.bags.mcap_file import BagConfig
from winding_recorder.bags.reading import Decoder
from winding_recorder.bags.writer import BagWriter
from winding_recorder.playback.recorded_buffer import recorded_run
from winding_ros import topics
from winding_ros.messages.clouds import encode_cloud
from winding_ros.messages.rig import encode_joint_state
from winding_supervisor.session.session import RunResult

DRIVE = DriveProfile()
ADVANCE = DRIVE.advance_per_radian
SECONDS, PERIOD = 18.0, 0.02
RECORDED = (topics.JOINT_STATES, topics.LAY_CONTROL_STATE, topics.TRACKED_LAY)
LIMITS = OperatorLimits(lay_tolerance=0.5e-3)
LAY, LENGTHS = "lay_tolerance_mm", "error_limit_pct"


def recording(folder: Path, *, off: float, mode: ControlMode = ControlMode.DRIVE) -> Path:
    """Record a made-up run whose cable lies off the wanted helix by a distance [m] in turn 4."""
    decoder = Decoder()
    writer = BagWriter(
        folder,
        [
            jazzy_channel(f"/cell/{t.name}", t.type_name, depth=t.depth, latched=t.latched)
            for t in RECORDED
        ],
        BagConfig(),
        {},
    )
    counts = dict.fromkeys(RECORDED, 0)

    def write(topic: topics.Topic, t: float, message: object) -> None:
        counts[topic] += 1
        data = decoder.canonical(topic.type_name, message)
        stamp = round(1e9 * t)
        writer.write(RECORDED.index(topic), StoredMessage(data, stamp, stamp, counts[topic]))

    for t in np.arange(0.0, SECONDS, PERIOD):
        (angle, guide), (speed, feed) = DRIVE.positions(t), DRIVE.speeds(t)
        reading = axis_reading(angle, guide, speed=speed, feed=feed)
        write(topics.JOINT_STATES, t, encode_joint_state(t, reading))
        record = np.zeros(1, LAY_CONTROL_DTYPE)
        record["mode"] = mode
        record["theta"] = angle
        record["wanted_z"] = ADVANCE * angle
        record["free_length"], record["sigma_free_length"] = 0.1958, 0.0055
        write(topics.LAY_CONTROL_STATE, t, encode_cloud(t, record))
    theta = np.arange(0.05, DRIVE.positions(SECONDS)[0], 0.09)
    places = np.zeros(theta.size, LAY_DTYPE)
    places["theta"], places["sigma_z"] = theta, 1.0e-4
    places["z"] = ADVANCE * theta + np.where(np.floor(theta / math.tau) == 3, off, 0.0)
    write(topics.TRACKED_LAY, SECONDS, encode_cloud(SECONDS, places))
    parameters = {"case": 4, "duration": SECONDS}
    writer.close(
        {
            COMPLETE: YES,
            f"{PARAMETERS}cable_fem": json.dumps(parameters),
            f"{PARAMETERS}winding_rig": json.dumps(parameters),
            f"{PARAMETERS}lay_control": json.dumps(parameters | {"control": "drive"}),
        }
    )
    return folder


@pytest.mark.slow
def test_recorded_run_has_its_report_and_its_verdict(tmp_path: Path) -> None:
    write_recorded_report(recording(tmp_path / "bag", off=0.3e-3), tmp_path / "out", LIMITS, [LAY])
    numbers = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))
    assert numbers["verdict"]["kept"] is True
    assert numbers["wall_s"] is None
    # Single precision of z in the records: 4 nm.
    assert numbers["lay"]["turns"][3]["error_largest_m"] == pytest.approx(0.3e-3, abs=1e-8)
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert "at most 0.30 mm off, in turn 4" in page


@pytest.mark.parametrize(
    ("mode", "given", "code"),
    [(ControlMode.DRIVE, [LAY], 1), (ControlMode.DRIVE, [], 0), (ControlMode.WATCH, [LAY], 0)],
)
def test_lay_that_was_driven_is_held_to_a_tolerance_that_was_given(
    mode: ControlMode, given: list[str], code: int, tmp_path: Path
) -> None:
    run = recorded_run(recording(tmp_path / "bag", off=0.7e-3, mode=mode))
    result = RunResult(buffer=run.buffer, wall_s=0.0, ending=Ending())
    record = run_record(
        Condition(case=4, duration=SECONDS),
        result,
        {},
        LIMITS,
        asked=Extent(time=SECONDS),
        parameters=run.parameters,
    )
    assert record.lay.verdict.kept is False
    assert bool(flaw(record, result, given)) is bool(code)
    # Nothing was corrected, so nothing is known to keep a limit of the errors.
    assert record.verdict.good is None
    assert flaw(record, result, []) == ""
    assert flaw(record, result, [LENGTHS])


def test_recording_without_its_condition_is_refused(tmp_path: Path) -> None:
    bag = recording(tmp_path / "bag", off=0.0)
    notes = bag / "metadata.yaml"
    notes.write_text(notes.read_text(encoding="utf-8").replace(PARAMETERS, "other "))
    with pytest.raises(BagError, match="does not say what was wound"):
        recorded_run(bag)
