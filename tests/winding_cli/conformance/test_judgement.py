"""Each promise is broken on purpose once, and found, by the command in real drivers too."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from winding_cli.cell.driver_judgement import (
    Finding,
    Heard,
    judge_camera,
    judge_clock,
    judge_encoder,
    judge_stream,
    judge_tension,
    runs,
    stands,
)

RUNNING = (1.74, 5.0e-3)


def winding_encoder(rate: float = 1000.0, seconds: float = 1.0) -> Heard:
    t = np.arange(0.0, seconds, 1.0 / rate)
    return Heard(
        stamps=t.tolist(),
        values=[(1.74 * x, 1.74, 5.0e-3 * x, 5.0e-3) for x in t.tolist()],
    )


def broken(findings: Iterable[Finding]) -> list[str]:
    return [finding.promise for finding in findings if not finding.kept]


def test_a_good_encoder_keeps_every_promise() -> None:
    heard = winding_encoder()
    assert not broken([*judge_stream("rig/joint_states", heard, 50.0), *judge_encoder(heard)])


def test_a_message_that_cannot_be_read_is_quoted() -> None:
    heard = winding_encoder()
    heard.refused.append("tension must be finite, got nan N")
    first = next(judge_stream("rig/tension", heard, 50.0))
    assert first.measured == "tension must be finite, got nan N"
    assert not first.kept


def back_in_time() -> Heard:
    heard = winding_encoder()
    heard.stamps[5] = heard.stamps[3]
    return heard


def with_a_gap() -> Heard:
    heard = winding_encoder()
    del heard.stamps[400:600], heard.values[400:600]
    return heard


def in_revolutions() -> Heard:
    heard = winding_encoder()
    heard.values = [(a, 60.0 * w / (2.0 * np.pi), z, v) for a, w, z, v in heard.values]
    return heard


@pytest.mark.parametrize(
    ("findings", "promise"),
    [
        (judge_stream("it", Heard(), 50.0), "it: every message can be read"),
        (judge_stream("it", back_in_time(), 50.0), "it: stamps increase"),
        (judge_stream("it", winding_encoder(rate=20.0), 50.0), "it: at least 50 Hz by its stamps"),
        (judge_encoder(with_a_gap()), "rig/joint_states: no gap above 100 ms"),
        (
            judge_encoder(in_revolutions()),
            "rig/joint_states: cylinder velocity is the rate of its position",
        ),
        (
            judge_tension(Heard(stamps=[0.0], values=[(-1.9,)])),
            "rig/tension: force.x pulls, in newton",
        ),
    ],
)
def test_a_broken_promise_is_found(findings: Iterable[Finding], promise: str) -> None:
    assert broken(findings) == [promise]


def test_a_frame_without_its_calibration_is_found() -> None:
    frames = Heard(stamps=[0.1, 0.2, 0.3, 0.4])
    calibrations = Heard(stamps=[0.1, 0.3, 0.4])
    assert broken(judge_camera(frames, calibrations, winding_encoder())) == [
        "camera/camera_info: one for each frame, with its stamp"
    ]


def test_of_two_topics_one_may_be_heard_first_and_last() -> None:
    frames = Heard(stamps=[0.1, 0.2, 0.3, 0.4])
    calibrations = Heard(stamps=[0.3, 0.4, 0.5])
    assert not broken(judge_camera(frames, calibrations, winding_encoder()))
    assert broken(judge_camera(frames, Heard(), winding_encoder()))


def test_a_camera_with_a_clock_of_its_own_is_found() -> None:
    frames = Heard(stamps=[1000.1, 1000.2])
    found = broken(judge_camera(frames, frames, winding_encoder()))
    assert found == ["camera/image_raw: stamped by the encoder's clock"]
    assert not judge_clock([frames, winding_encoder()]).kept


def test_running_and_standing_leave_a_gap_between_them() -> None:
    assert runs((0.0, 1.0, 0.0, 3.0e-3), RUNNING)
    assert stands((0.0, 0.01, 0.0, 1.0e-5), RUNNING)
    slow = (0.0, 0.1, 0.0, 3.0e-4)
    assert not runs(slow, RUNNING)
    assert not stands(slow, RUNNING)
    assert not stands((0.0, 0.0, 0.0, 3.0e-4), RUNNING)


@pytest.mark.processes
@pytest.mark.parametrize(
    ("driver", "broken", "moved"),
    [
        (
            {'"rig/{name}", getattr': '"rig/{name}_", getattr'},
            "BROKEN  rig/start: a std_srvs/srv/Trigger service: not there",
            False,
        ),
        (
            {"0.0, 0.0, True, True": "0.0, 0.0, False, True"},
            "BROKEN  rig/start after an emergency stop",
            True,
        ),
    ],
    indirect=["driver"],
    ids=["without services, which moves nothing", "with an emergency stop that does not latch"],
)
def test_a_driver_that_breaks_a_promise_is_found(
    driver: Any, broken: str, moved: bool, tmp_path: Path, command: Callable[..., Any]
) -> None:
    done = command(
        *("conform", "--namespace", driver.namespace, "--no-camera", "--seconds", 0.5, "--move"),
        cwd=tmp_path,
    )
    assert done.returncode == 1
    assert broken in done.stdout
    assert ("both axes wind" in done.stdout) is moved


@pytest.mark.processes
def test_no_driver_is_reported_in_one_sentence(tmp_path: Path, command: Callable[..., Any]) -> None:
    done = command("conform", "--namespace", "empty", "--no-camera", cwd=tmp_path)
    assert done.returncode == 1
    assert "no sample on rig/joint_states within 10 s" in done.stderr
    assert done.stderr.count("\n") == 1
