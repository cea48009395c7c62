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


TIMES = [pytest.approx(0.01 * k) for k in range(100)]
PASSED = {
    (FaultKind.OFF, 0.0): [],
    # The first value, with a time that goes on.
    (FaultKind.STUCK, 0.0): [(t, 0.0) for t in TIMES],
    (FaultKind.WRONG, -1.0): [(t, -float(k)) for k, t in enumerate(TIMES)],
    (FaultKind.SLOW, 10.0): [(TIMES[k], float(k)) for k in range(0, 100, 10)],
    # In order, with the time of the measurement.
    (FaultKind.DELAYED, 0.05): [(TIMES[k], float(k)) for k in range(95)],
}


@pytest.mark.parametrize(("kind", "amount"), PASSED)
def test_each_kind_passes_what_it_states(kind: FaultKind, amount: float) -> None:
    assert through(kind, amount) == PASSED[kind, amount]


def test_garbage_is_never_a_number() -> None:
    assert not np.isfinite([value for _, value in through(FaultKind.GARBAGE)]).any()


def test_garbage_of_pixels_is_other_pixels() -> None:
    frame = np.full((40, 50, 3), 7, dtype=np.uint8)
    (delivered,) = channel(FaultKind.GARBAGE).deliver(0.0, frame)
    assert delivered.values.dtype == np.uint8
    assert delivered.values.shape == frame.shape
    # Uniform bytes: the mean of 6000 is 127.5 within five standard errors of 0.95.
    assert delivered.values.mean() == pytest.approx(127.5, abs=4.8)


def test_wrong_clips_pixels() -> None:
    (delivered,) = channel(FaultKind.WRONG, 2.0).deliver(0.0, np.array([100, 200], dtype=np.uint8))
    assert delivered.values.tolist() == [200, 255]


def test_intermittent_loses_its_share() -> None:
    count = 5000
    kept = len(through(FaultKind.INTERMITTENT, 0.2, count))
    # Five standard deviations of a binomial draw.
    assert kept / count == pytest.approx(0.8, abs=5.0 * (0.2 * 0.8 / count) ** 0.5)


def test_healthy_signal_passes_untouched() -> None:
    faults = Faults(parse_faults("camera:off", TARGETS))
    assert faults.through("load_cell", 0.0, 4.2) == 4.2
    assert faults.through("camera", 0.0, 4.2) is None


def test_text_states_faults_with_their_usual_amounts() -> None:
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
def test_text_that_states_no_fault_is_refused(text: str) -> None:
    with pytest.raises(FaultError) as refusal:
        parse_faults(text, TARGETS)
    assert NO_FAULTS[text] in str(refusal.value)


@pytest.mark.parametrize("target", ["camera", "camera/image_raw", "camera/camera_info"])
def test_no_fault_of_a_camera_that_runs_elsewhere(target: str) -> None:
    text = f"load_cell:off,{target}:off"
    assert enabled_faults(text, enabled=True, seed=0).of(target) is not None
    with pytest.raises(FaultError, match=f"another process: no fault of {target}"):
        enabled_faults(text, enabled=True, seed=0, camera_elsewhere=True)
