"""Each promise is broken on purpose once, and found, by the command in real drivers too."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from winding_cli.cell.driver_judgement import (
    Finding,
    Heard,
    camera_lead,
    judge_camera,
    judge_clock,
    judge_encoder,
    judge_stream,
    judge_tension,
    runs,
    stands,
)

RUNNING = (1.74, 5.0e-3)
CAMERA_CLOCK = "camera/image_raw: stamped at exposure by the encoder's clock"


def winding_encoder(rate: float = 1000.0, seconds: float = 1.0) -> Heard:
    t = np.arange(0.0, seconds, 1.0 / rate)
    return Heard(
        stamps=t.tolist(), values=[(1.74 * x, 1.74, 5.0e-3 * x, 5.0e-3) for x in t.tolist()]
    )


def broken(findings: Iterable[Finding]) -> list[str]:
    return [finding.promise for finding in findings if not finding.kept]


@pytest.fixture
def conform(driver: Any, tmp_path: Path, command: Any) -> Callable[..., Any]:
    """Hold a driver to its promises, by the command."""
    words = ("conform", "--namespace", driver.namespace, "--no-camera", "--seconds")
    return lambda *further: command(*words, *further, cwd=tmp_path)


def test_a_good_encoder_keeps_every_promise() -> None:
    heard = winding_encoder()
    assert not broken([*judge_stream("rig/joint_states", heard, 50.0), *judge_encoder(heard)])


def test_a_camera_of_exactly_the_lowest_rate_is_fast_enough() -> None:
    # Whole nanoseconds of a clock since 1970 differ from a twenty-fifth of a second.
    for begin in (0.0, 1.79e9, 1.79e9 + 0.1234567):
        stamps = [begin + k / 25.0 for k in range(11)]
        stamps[-1] += 3.0e-9
        heard = Heard(stamps=stamps, values=[()] * 11, arrived=list(stamps))
        assert not broken(judge_stream("camera/image_raw", heard, 25.0))


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
    assert not broken(judge_camera(frames, Heard(stamps=[0.3, 0.4, 0.5]), winding_encoder()))
    assert broken(judge_camera(frames, Heard(), winding_encoder()))


def test_a_camera_with_a_clock_of_its_own_is_found() -> None:
    frames = Heard(stamps=[1000.1, 1000.2])
    assert broken(judge_camera(frames, frames, winding_encoder())) == [CAMERA_CLOCK]
    assert not judge_clock([frames, winding_encoder()]).kept


def arriving(rate: float, *, offset: float, latency: float, epoch: float = 2.0e9) -> Heard:
    """Return what is heard of a topic whose clock is ahead by an offset [s]."""
    t = epoch + np.arange(0.0, 2.0, 1.0 / rate)
    late = np.random.default_rng(3).exponential(1.0e-3, len(t))
    return Heard(stamps=(t + offset).tolist(), arrived=(t + latency + late).tolist())


@pytest.mark.parametrize(
    ("rate", "offset", "latency", "kept"),
    [
        (125.0, 0.0, 0.006, True),
        (125.0, 0.053, 0.009, False),
        (30.0, 0.053, 0.041, False),
        (30.0, -0.021, 0.012, True),
        (500.0, 0.0071, 0.0015, False),
    ],
)
@pytest.mark.parametrize("encoder_epoch", [0.0, 5.0e4], ids=["system's clock", "own clock"])
def test_the_cameras_clock_is_a_number_with_its_uncertainty(
    rate: float, offset: float, latency: float, kept: bool, encoder_epoch: float
) -> None:
    joints = arriving(400.0, offset=-encoder_epoch, latency=0.0002)
    frames = arriving(rate, offset=offset - encoder_epoch, latency=latency)
    lead = camera_lead(frames, joints)
    # The quickest twentieth of the messages waited for 0.05 ms.
    assert abs(lead.offset - offset) <= lead.error + 2.0e-4
    # Stamps since 1970 are known to 0.24 us.
    assert lead.error == pytest.approx(1.0 / rate, abs=1.0e-6)
    clock = list(judge_camera(frames, frames, joints))[-1]
    assert clock.promise == CAMERA_CLOCK
    assert f"{1e3 * lead.offset:+.1f} +- {1e3 / rate:.1f} ms ahead" in clock.measured
    assert clock.kept is kept
    assert ("--camera-clock-correction" in clock.measured) is not kept


@pytest.mark.parametrize("first", [0, 1, 2], ids="without {} frames".format)
def test_a_film_at_a_fifth_of_its_speed_has_one_clock(first: int) -> None:
    t = 0.04 * np.arange(11)
    late = np.random.default_rng(5).exponential(2.0e-3, (2, len(t)))
    joints, frames = (Heard(stamps=list(t), arrived=list(100.0 + 5.0 * t + e)) for e in late)
    frames = Heard(stamps=frames.stamps[first:], arrived=frames.arrived[first:])
    lead = camera_lead(frames, joints)
    # Messages wait for 2 ms in the mean, which are 0.4 ms of the film.
    assert abs(lead.least) <= 1.0e-3


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
        ({'"rig/{name}", getattr': '"rig/{name}_", getattr'},
         "BROKEN  rig/start: a std_srvs/srv/Trigger service: not there", False),
        ({"0.0, 0.0, True, True": "0.0, 0.0, False, True"},
         "BROKEN  rig/start after an emergency stop", True),
    ],
    indirect=["driver"],
    ids=["without services, which moves nothing", "with an emergency stop that does not latch"],
)  # fmt: skip
def test_a_driver_that_breaks_a_promise_is_found(conform: Any, broken: str, moved: bool) -> None:
    done = conform(0.5, "--move")
    assert done.returncode == 1
    assert broken in done.stdout
    assert ("both axes wind" in done.stdout) is moved


@pytest.mark.processes
def test_no_driver_is_reported_in_one_sentence(tmp_path: Path, command: Callable[..., Any]) -> None:
    done = command("conform", "--namespace", "empty", "--no-camera", cwd=tmp_path, code=1)
    assert "no message on rig/joint_states within 10 s" in done.stderr
    assert done.stderr.count("\n") == 1


ONE_EACH = """for k, name in enumerate(state.name):
                one = JointState(header=state.header, name=[name])
                one.position = state.position[k : k + 1]
                self.joints.publish(one)"""


@pytest.mark.processes
@pytest.mark.parametrize(
    ("driver", "sentence"),
    [
        (
            {'["cylinder_joint", "carriage_joint"]': '["mandrel", "sled"]'},
            "messages/s arrive on rig/joint_states with joints mandrel, sled; configured are "
            "cylinder_joint and carriage_joint: --cylinder-joint and --carriage-joint name others",
        ),
        (
            {"self.joints.publish(state)": ONE_EACH},
            "messages/s arrive on rig/joint_states with joints carriage_joint, cylinder_joint, one "
            "in each; each message needs both cylinder_joint and carriage_joint",
        ),
        (
            {"state.position = [self.angle,": "state.position = [float('nan'),"},
            "messages/s arrive on rig/joint_states and none can be read: joint state must be "
            "finite",
        ),
    ],
    indirect=["driver"],
    ids=["other names", "one joint in each message", "not a number"],
)
def test_joint_states_that_are_of_no_use_are_described(conform: Any, sentence: str) -> None:
    done = conform(1)
    assert done.returncode == 1
    rate, _, rest = done.stderr.strip().removeprefix("winding: ").partition(" ")
    assert int(rate) > 0
    assert rest.startswith(sentence), done.stderr


BEFORE = "rig/joint_targets before rig/start: change nothing"
LATE = "rig/joint_targets stamped 2 s ago: change nothing"
FOLLOWED = "rig/joint_targets while it winds: the carriage goes where it is commanded"
LOST = "rig/joint_targets end in motion: both axes stand within 2 s"


@pytest.mark.campaign
@pytest.mark.processes
@pytest.mark.parametrize(
    ("driver", "broken"),
    [
        ({}, None),
        ({"if not self.goal or abs": "if abs", "self.share * min(max(way": "min(max(way"}, BEFORE),
        ({"or abs(age) > DEAD_MAN": ""}, LATE),
        ({"way / 0.05": "way / 50.0"}, FOLLOWED),
        ({"since > DEAD_MAN": "since > 1.0e9"}, LOST),
    ],
    indirect=["driver"],
    ids=["all kept", "takes early ones", "takes late ones", "lags", "goes on without"],
)
def test_what_a_driver_does_with_commands_is_found(conform: Any, broken: str | None) -> None:
    done = conform(0.5, "--move")
    lines = done.stdout.splitlines()
    found = [line.removeprefix("BROKEN  ") for line in lines if line.startswith("BROKEN")]
    assert [line.startswith(broken) for line in found] == ([True] if broken else []), done.stdout
    for promise in {BEFORE, LATE, FOLLOWED, LOST} - {broken}:
        assert any(line.startswith(f"kept    {promise}") for line in lines), done.stdout
