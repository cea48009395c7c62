"""Faults on purpose: what they do to a signal, and which are refused."""

import numpy as np
import pytest

from winding_rig_node.machine.faults import (
    Fault,
    FaultError,
    FaultKind,
    Faults,
    FaultyChannel,
    parse_faults,
)
from winding_rig_node.ros.inputs import enabled_faults

TARGETS = ("load_cell", "camera", "/clock")


def channel(kind: FaultKind, amount: float = 0.0) -> FaultyChannel:
    fault = Fault(target="load_cell", kind=kind, amount=amount)
    return FaultyChannel(fault, np.random.default_rng(3))


def through(kind: FaultKind, amount: float = 0.0, count: int = 100) -> list[tuple[float, float]]:
    """Put 0, 1, 2, ... in, one each 10 ms; return (claimed time, value) of what comes out."""
    faulty = channel(kind, amount)
    out = []
    for k in range(count):
        delivered = faulty.deliver(0.01 * k, np.array([float(k)]))
        out += [(item.t, float(item.values[0])) for item in delivered]
    return out


def test_off_says_nothing():
    assert through(FaultKind.OFF) == []


def test_stuck_repeats_the_first_value_with_a_time_that_goes_on():
    out = through(FaultKind.STUCK)
    assert [value for _, value in out] == [0.0] * 100
    assert out[-1][0] == pytest.approx(0.99)


def test_garbage_is_never_a_number():
    assert not np.isfinite([value for _, value in through(FaultKind.GARBAGE)]).any()


def test_garbage_of_pixels_is_other_pixels():
    frame = np.full((40, 50, 3), 7, dtype=np.uint8)
    (delivered,) = channel(FaultKind.GARBAGE).deliver(0.0, frame)
    assert delivered.values.dtype == np.uint8
    assert delivered.values.shape == frame.shape
    # Uniform bytes: the mean of 6000 is 127.5 within five standard errors of 0.95.
    assert delivered.values.mean() == pytest.approx(127.5, abs=4.8)


def test_wrong_scales_numbers_and_clips_pixels():
    assert through(FaultKind.WRONG, -1.0)[5] == (0.05, -5.0)
    (delivered,) = channel(FaultKind.WRONG, 2.0).deliver(0.0, np.array([100, 200], dtype=np.uint8))
    assert delivered.values.tolist() == [200, 255]


def test_slow_lets_one_in_so_many_through():
    assert [value for _, value in through(FaultKind.SLOW, 10.0)] == list(range(0, 100, 10))


def test_delayed_keeps_order_and_claims_the_old_time():
    out = through(FaultKind.DELAYED, 0.05)
    assert out == [(pytest.approx(0.01 * k), float(k)) for k in range(95)]


def test_intermittent_loses_its_share():
    count = 5000
    kept = len(through(FaultKind.INTERMITTENT, 0.2, count))
    # Five standard deviations of a binomial draw.
    assert kept / count == pytest.approx(0.8, abs=5.0 * (0.2 * 0.8 / count) ** 0.5)


def test_healthy_signal_passes_untouched():
    faults = Faults(parse_faults("camera:off", TARGETS))
    assert faults.through("load_cell", 0.0, 4.2) == 4.2
    assert faults.through("camera", 0.0, 4.2) is None


def test_text_states_faults_with_their_usual_amounts():
    assert parse_faults("", TARGETS) == ()
    assert parse_faults("load_cell:stuck, camera:intermittent", TARGETS) == (
        Fault(target="load_cell", kind=FaultKind.STUCK),
        Fault(target="camera", kind=FaultKind.INTERMITTENT, amount=0.2),
    )


NO_FAULTS = {
    "camrea:off": "no signal 'camrea'; there are /clock, camera, load_cell",
    "camera": "written target:kind",
    "camera:broken": "no fault 'broken'",
    "camera:off:1": "fault off has no amount",
    "camera:intermittent:1.5": "must be 0 to 1, got 1.5",
    "camera:intermittent:nan": "must be 0 to 1, got nan",
    "camera:slow:x": "must be a number, got 'x'",
    "camera:off,camera:stuck": "camera is given two faults",
}


@pytest.mark.parametrize("text", NO_FAULTS)
def test_text_that_states_no_fault_is_refused(text):
    with pytest.raises(FaultError) as refusal:
        parse_faults(text, TARGETS)
    assert NO_FAULTS[text] in str(refusal.value)


@pytest.mark.parametrize("target", ["camera", "camera/image_raw", "camera/camera_info"])
def test_no_fault_of_a_camera_that_runs_elsewhere(target):
    text = f"load_cell:off,{target}:off"
    assert enabled_faults(text, enabled=True, seed=0).of(target) is not None
    with pytest.raises(FaultError, match=f"another process: no fault of {target}"):
        enabled_faults(text, enabled=True, seed=0, camera_elsewhere=True)
