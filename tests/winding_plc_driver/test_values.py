"""Values that the server sends: each once, in order, joined into samples, and losses counted."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from winding_plc_driver.machine.joining import Joiner, Pacer, Sample
from winding_plc_driver.machine.mapping import Variable
from winding_plc_driver.machine.reading import SequenceNumbers, ServerValue, VariableReader

WAIT = 0.1


def joiner() -> Joiner:
    return Joiner(("angle", "carriage"), WAIT)


def values(samples: list[Sample]) -> list[tuple[int, float, float]]:
    return [(s.stamp_ns, s.values["angle"], s.values["carriage"]) for s in samples]


def test_values_of_one_timestamp_are_one_sample() -> None:
    join = joiner()
    join.add("angle", 10, 1.0, 0.0)
    assert join.take(0.0) == []
    join.add("carriage", 10, 2.0, 0.01)
    assert values(join.take(0.01)) == [(10, 1.0, 2.0)]
    assert join.counts.joined == 1


def test_a_value_alone_meets_the_other_axis_between_its_neighbours() -> None:
    join = joiner()
    for ns, position in ((10, 1.0), (30, 3.0)):
        join.add("carriage", ns, position, 0.0)
    join.add("angle", 10, 0.0, 0.0)
    join.add("angle", 20, 5.0, 0.0)
    assert values(join.take(0.0)) == [(10, 0.0, 1.0), (20, 5.0, 2.0)]
    assert join.counts.interpolated == 1


def test_an_axis_that_stays_silent_stands() -> None:
    join = joiner()
    join.add("angle", 10, 0.0, 0.0)
    join.add("carriage", 10, 2.0, 0.0)
    join.add("angle", 20, 1.0, 0.02)
    assert values(join.take(0.02)) == [(10, 0.0, 2.0)]
    assert values(join.take(0.02 + WAIT)) == [(20, 1.0, 2.0)]
    assert join.counts.held == 1
    join.add("carriage", 15, 2.5, 0.2)
    assert join.take(1.0) == []
    assert join.counts.late == 1


@given(st.lists(st.booleans(), min_size=1, max_size=30), st.integers(1, 5))
def test_samples_do_not_depend_on_how_notifications_are_cut(order: list[bool], cut: int) -> None:
    """Each axis in its own order; both tell every timestamp."""
    queues = {name: list(range(1, 21)) for name in ("angle", "carriage")}
    join, samples = joiner(), []
    picks = [("angle" if first else "carriage") for first in order] * 40
    for count, name in enumerate(picks):
        if queues[name]:
            ns = queues[name].pop(0)
            join.add(name, ns, float(ns), 0.0)
        if count % cut == 0:
            samples += join.take(0.0)
    for name, queue in queues.items():
        for ns in queue:
            join.add(name, ns, float(ns), 0.0)
    samples += join.take(0.0)
    assert values(samples) == [(ns, float(ns), float(ns)) for ns in range(1, 21)]


def test_what_comes_as_it_was_measured_is_passed_on_at_once_and_in_order() -> None:
    pacer = Pacer(0.0)
    for ns in (30, 10, 20):
        pacer.add(ns, float(ns))
    assert pacer.take(0.0) == [(10, 10.0), (20, 20.0), (30, 30.0)]


def test_a_long_queue_is_passed_on_at_four_times_its_pace() -> None:
    pacer, step = Pacer(0.0), 10_000_000
    for k in range(500):
        pacer.add(k * step, float(k))
    # 20 ms at four times the pace of 100 Hz are 8 values after the first.
    assert len(pacer.take(0.02)) == 9
    assert len(pacer.take(0.04)) == 9
    # However late the next look is, no more than half a second's worth goes at once.
    bursts = [len(pacer.take(1.0 * look)) for look in range(1, 20)]
    assert max(bursts) <= 51
    assert sum(bursts) == 500 - 18


def value(number: object, ns: int | None, **further: bool | str) -> ServerValue:
    return ServerValue(title="angle", value=number, stamp_ns=ns, **further)  # type: ignore[arg-type]


def test_a_value_is_taken_once_and_losses_are_counted() -> None:
    reader = VariableReader("angle", Variable(node="i=1", unit="deg", scale=-2.0))
    assert reader.read(value(90.0, 10)) == (10, -math.pi)
    assert reader.read(value(90.0, 10)) is None
    assert reader.read(value(91, 20, overflow=True)) is not None
    assert (reader.taken, reader.repeated, reader.overflows) == (2, 1, 1)
    assert reader.read(value(91.0, 30, bad="BadSensorFailure")) is None
    assert reader.complaint == "angle has the status BadSensorFailure"
    for unusable in (value("text", 40), value(math.nan, 40), value(None, 40), value(1.0, None)):
        assert reader.read(unusable) is None
        assert reader.complaint
    assert reader.unusable == 5
    assert reader.read(value(91.0, 50)) is not None
    assert reader.complaint == ""


def test_an_angle_that_starts_again_goes_on() -> None:
    reader = VariableReader("angle", Variable(node="i=1", unit="turn", wraps_at=1.0))
    read = [reader.read(value(raw, 10 * k)) for k, raw in enumerate((0.8, 0.1, 0.9, 0.3), 1)]
    turns = [item[1] / (2.0 * math.pi) for item in read if item is not None]
    assert turns == pytest.approx([0.8, 1.1, 0.9, 1.3])


def test_missing_and_repeated_notifications_show() -> None:
    numbers = SequenceNumbers()
    assert numbers.take(1)
    assert numbers.missing(2) == []
    assert numbers.missing(4) == [2, 3]
    numbers.skip(2)
    assert numbers.take(3)
    assert numbers.take(4)
    assert not numbers.take(3)
    assert numbers.missing(3) == []
    assert (numbers.gaps, numbers.repeated) == (1, 1)


def test_numbers_begin_again_with_one() -> None:
    numbers = SequenceNumbers()
    numbers.skip(2**32 - 2)
    assert numbers.missing(2) == [2**32 - 1, 1]
