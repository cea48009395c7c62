"""Every kind of ending has one outcome: on terminal, run.json, report, page and goal result."""

import asyncio
import html
import json
import os
import re
import uuid
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recordings import recorded

from winding_cli.cell.goals import Goal, GoalState
from winding_recorder.bags.check import check
from winding_ros.environment import set_process_environment
from winding_ros.messages.stamps import serialised_stamp
from winding_verification.faults.judgement import disagreements
from winding_verification.faults.trial import Fault, Plan, Trial

pytestmark = [pytest.mark.processes, pytest.mark.campaign, pytest.mark.timeout(900)]

DRIVER = Path(__file__).parents[2] / "examples" / "driver_node.py"
PAGE = ("-0.1 hear", "-0.2 start")
SET = "role set winding_rig inject_fault"
TURNING = "THE MACHINE still turns: the stop could not be delivered: "


@dataclass(frozen=True, kw_only=True)
class Kind:
    """An ending, and what of its outcome is known beforehand."""

    faults: tuple[str, ...] = ()
    ended_by: str = "completed"
    verdict: str = "not judged"
    machine: str = "standing"
    sentence: str = ""  # Pattern of one of its sentences
    code: int = 0
    foreign: bool = False
    options: tuple[str, ...] = ()
    duration: float = 3.0


FAILED: dict[str, Any] = {"verdict": "failed", "code": 1}
MACHINE: dict[str, Any] = {**FAILED, "ended_by": "machine", "foreign": True}
OPERATED: dict[str, Any] = {"options": ("--dashboard",)}
RECORDED: dict[str, Any] = {"options": ("--bag", "bag")}
ARM: dict[str, Any] = {
    "options": ("--machine-file", str(DRIVER.parent / "arm" / "arm.yaml"), "--lay", "driven")
}
KINDS = {
    "the end": Kind(sentence=r"^completed: 0\.69 of 0\.69 turns, 3\.00 of 3\.00 s"),
    "SIGINT": Kind(
        faults=("1.1 signal INT",), ended_by="signal", verdict="incomplete", code=130,
        sentence="^ended by a signal after .* of 0.69 turns.*: SIGINT came$",
    ),
    "SIGTERM": Kind(
        faults=("0.6 signal TERM",), ended_by="signal", verdict="incomplete", code=130, **RECORDED,
        sentence="^ended by a signal after .* of 0.69 turns.*: SIGTERM came$",
    ),
    "the machine's process dies": Kind(
        faults=("0.9 kill winding_rig",), ended_by="supervision", **FAILED, **RECORDED,
        sentence="^ended by supervision after .*: winding_rig ended with exit code -9",
    ),
    "SIGINT with an arm": Kind(
        faults=("1.1 signal INT",), ended_by="signal", verdict="incomplete", code=130, **ARM,
        sentence="^ended by a signal after .* of 0.69 turns.*: SIGINT came$",
    ),
    "the process of a machine with an arm dies": Kind(
        faults=("0.9 kill winding_rig",), ended_by="supervision", **FAILED, **ARM,
        sentence="^ended by supervision after .*: winding_rig ended with exit code -9",
    ),
    "the guide's encoders of an arm stick": Kind(
        faults=(f"0.7 {SET} carriage_encoder:stuck",), ended_by="machine", duration=6.0, **FAILED,
        **ARM, sentence="^ended by the machine .*carriage encoder is stuck",
    ),
    "a load cell without readings": Kind(
        faults=(f"0.7 {SET} load_cell:garbage",), ended_by="machine", duration=6.0, **FAILED,
        sentence="^ended by the machine .*load cell gives no valid reading",
    ),
    "a silent topic": Kind(
        faults=(f"0.7 {SET} rig/tension:off",), ended_by="supervision", duration=9.0, **FAILED,
        sentence="^ended by supervision .*rig/tension is silent",
    ),
    "a second publisher": Kind(
        faults=("0.2 role rogue",), ended_by="supervision", duration=9.0, **FAILED,
        sentence="^ended by supervision .*rig/tension has 2 publishers",
    ),
    "a full disk": Kind(
        faults=("0.7 disk",), **RECORDED, code=1,
        sentence="^the recording is incomplete: ",
    ),
    "the end of a foreign machine": Kind(foreign=True, sentence="^completed: "),
    "a stop without an answer": Kind(
        faults=("0.4 machine stops unanswered",), foreign=True, machine="turning", **FAILED,
        sentence=f"^{TURNING}.*no answer from rig/stop in 0.8 s",
    ),
    "a stop that is refused after SIGINT": Kind(
        faults=("0.4 machine stops refused", "1.2 signal INT"), foreign=True, machine="turning",
        ended_by="signal", **FAILED, sentence=f"^{TURNING}.*rig/stop was refused: interlocked",
    ),
    "a stop without an answer when the solver has died": Kind(
        faults=("0.4 machine stops unanswered", "1.0 kill cable_fem"), foreign=True,
        ended_by="supervision", machine="turning", **FAILED,
        sentence=f"^{TURNING}.*quick_stop in 0.8 s; no answer from rig/stop in 0.8 s",
    ),
    "a stop that does nothing": Kind(
        faults=("0.4 machine stops ignored",), foreign=True, machine="turning", **FAILED,
        sentence="^THE MACHINE still turns",
    ),
    "a second publisher before the end of a machine that does not stop": Kind(
        faults=("0.3 machine stops ignored", "1.0 role rogue truncated"), foreign=True,
        ended_by="supervision", machine="turning", **FAILED,
        sentence="^ended by supervision .*rig/tension has 2 publishers",
    ),
    "a machine that stops early": Kind(
        faults=("1.3 machine stops early",), duration=4.0, **MACHINE,
        sentence="^ended by the machine .*the machine stopped by itself after",
    ),
    "a driver that dies": Kind(
        faults=("1.2 kill driver",), duration=5.0, **MACHINE | {"machine": "unknown"},
        sentence="^THE MACHINE was not seen standing",
    ),
    "a driver that is held": Kind(
        faults=("1.2 hold driver",), duration=5.0, **MACHINE | {"machine": "unknown"},
        sentence="^ended by the machine .*are silent for",
    ),
    "the end on the page": Kind(faults=PAGE, sentence="^completed: ", **OPERATED),
    "a stop by the operator": Kind(
        # It might be resumed until the operator resets the machine.
        faults=(*PAGE, "0.8 role call rig/stop", "3.0 role call rig/reset"),
        ended_by="operator", verdict="incomplete", duration=8.0, **OPERATED,
        sentence="^ended by the operator .*: stopped by the operator",
    ),
    "an emergency stop": Kind(
        faults=(*PAGE, "0.8 role call rig/emergency_stop"), duration=8.0,
        ended_by="operator", verdict="incomplete", **OPERATED,
        sentence="^ended by the operator .*: emergency stop",
    ),
    "the machine's process dies beside a page": Kind(
        faults=(*PAGE, "0.9 kill winding_rig"), ended_by="supervision", **FAILED, **OPERATED,
        sentence="^ended by supervision .*winding_rig ended with exit code -9",
    ),
    "a foreign machine that stops early beside a page": Kind(
        faults=(*PAGE, "1.3 machine stops early"), duration=4.0, **MACHINE, **OPERATED,
        sentence="^ended by the machine .*the machine stopped by itself after",
    ),
}  # fmt: skip


@pytest.fixture(autouse=True)
def environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RCUTILS_CONSOLE_OUTPUT_FORMAT", "")
    monkeypatch.setenv("ROS_LOG_DIR", os.environ.get("ROS_LOG_DIR", ""))
    set_process_environment(int(os.environ["ROS_DOMAIN_ID"]), tmp_path / "log")


@pytest.mark.parametrize("name", KINDS)
def test_an_ending_has_one_outcome_wherever_it_is_read(name: str, tmp_path: Path) -> None:
    kind = KINDS[name]
    faults = (item.partition(" ") for item in kind.faults)
    plan = Plan(
        name=name,
        faults=tuple(Fault(at=float(at), what=what) for at, _, what in faults),
        foreign=kind.foreign,
        options=kind.options,
        duration=kind.duration,
    )
    folder = tmp_path / "trial"

    async def conduct() -> None:
        trial = Trial(plan, folder, f"ending{list(KINDS).index(name)}", DRIVER)
        account = await trial.conduct()
        assert disagreements(plan, account) == [], account.printed
        outcome = account.run["outcome"]
        found = (outcome["ended_by"], outcome["verdict"], outcome["machine"], account.code)
        assert found == (kind.ended_by, kind.verdict, kind.machine, kind.code), account.printed
        sentences = outcome["sentences"]
        assert any(re.search(kind.sentence, item) for item in sentences), sentences
        # A disk that is full has no room for a report.
        report = folder / "run" / "report" / "index.html"
        assert report.exists() == (name != "a full disk")
        page = report.read_text(encoding="utf-8") if report.exists() else account.printed
        shown = html.unescape(re.sub(r"<[^>]+>", "", page))
        for sentence in sentences:
            assert sentence in account.printed
            assert sentence in shown
        if "--dashboard" in kind.options:
            assert json.dumps(sentences) in account.answers
        if "--bag" in kind.options and kind.ended_by != "completed":
            assert check(folder / "bag").findings == []
            # Of a thousand encoder samples a second none is missing up to the end.
            samples = recorded(folder / "bag", "rig/joint_states")
            gaps = np.diff([serialised_stamp(sample) for sample in samples])
            assert gaps.size > 0
            np.testing.assert_allclose(gaps, 1.0e-3, atol=1.0e-6)
        goal = Goal(id=uuid.uuid4(), accepted_ns=0, folder=folder / "run")
        goal.state = GoalState.ABORTED
        assert goal.result()["outcome"] == outcome

    asyncio.run(conduct())
