"""What the driver does without a network: mapping, values, link and heartbeats."""

import math
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from winding_core.machine.joining import Joiner, Sample
from winding_core.machine.readings import CABLE_TENSION, Quantity
from winding_plc_driver.machine.link import HeartbeatWatch, Link
from winding_plc_driver.machine.mapping import (
    Heartbeat,
    MappingError,
    Server,
    Variable,
    parse_mapping,
    read_mapping,
    read_password,
)
from winding_plc_driver.machine.pacing import Pacer
from winding_plc_driver.machine.reading import SequenceNumbers, ServerValue, VariableReader

EXAMPLE = Path(__file__).parents[2] / "examples" / "opcua_machine.yaml"


def parse(folder: Path, **sections: dict[str, Any]) -> Any:
    """Return the example's mapping with keys of its sections changed; None takes one out."""
    content = yaml.safe_load(EXAMPLE.read_text(encoding="utf-8"))
    for section, changes in sections.items():
        content[section] = {
            key: value
            for key, value in (content.get(section, {}) | changes).items()
            if value is not None
        }
    return parse_mapping(yaml.safe_dump(content), folder)


def test_values_become_si() -> None:
    mapping = read_mapping(EXAMPLE)
    assert mapping.variables["angle"].factor == math.pi / 180.0
    assert mapping.axes == ("angle", "carriage", "angular_speed", "feed_speed")
    assert mapping.commands["quick_stop"].method.endswith("QuickStop")


def test_every_quantity_of_the_graph_may_be_a_variable(tmp_path: Path) -> None:
    humidity = Quantity(name="humidity", unit="1", sensor="hygrometer", field="relative_humidity")
    content = yaml.safe_load(EXAMPLE.read_text(encoding="utf-8"))
    content["variables"]["humidity"] = {"node": "i=9", "unit": "1", "scale": 0.01}
    mapping = parse_mapping(yaml.safe_dump(content), tmp_path, (CABLE_TENSION, humidity))
    assert mapping.measured == ("tension", "humidity")
    assert mapping.variables["humidity"].factor == 0.01
    with pytest.raises(MappingError, match="no parameter humidity"):
        parse_mapping(yaml.safe_dump(content), tmp_path)


def test_a_plc_without_quick_stop_is_stopped(tmp_path: Path) -> None:
    command = {"node": "ns=3;i=7", "value": 2}
    mapping = parse(tmp_path, commands={"quick_stop": None, "stop": command})
    assert mapping.commands["quick_stop"] == mapping.commands["stop"]
    assert mapping.commands["stop"].value == 2


@pytest.mark.parametrize(
    ("section", "changes", "sentence"),
    [
        ("server", {"queue": 5}, "server has no parameter queue; did you mean queue_size?"),
        ("server", {"endpoint": None}, "endpoint must be an address such as"),
        ("server", {"endpoint": "opc.tcp://me:secret@plc:4840"}, "without a user name"),
        ("server", {"queue_size": "many"}, "parameter queue_size must be a int, got 'many'"),
        ("server", {"publishing_interval_s": 20}, "must be at most 10, got 20"),
        ("server", {"security_policy": "Basic128"}, "must be one of None, Basic256Sha256"),
        ("server", {"security_policy": "Basic256Sha256"}, "needs certificate and private_key"),
        ("server", {"user": "me"}, "needs one of password_variable and password_file"),
        ("server", {"user_certificate": "me.der"}, "certificate needs its key and the other way"),
        ("server", {"user_private_key": "me.pem"}, "certificate needs its key and the other way"),
        ("server",
         {"user": "me", "password_file": "word", "user_certificate": "c", "user_private_key": "k"},
         "a session has one user, by name or by certificate, got user 'me'"),
        ("variables", {"angle": None}, "variables needs angle"),
        ("variables", {"angel": {}}, "variables has no parameter angel; did you mean angle?"),
        ("variables", {"angle": 3}, "variable angle must be a mapping of names, got 3"),
        ("variables", {"angle": {"unit": "deg"}}, "node of variable angle must be a node id"),
        ("variables", {"angle": {"node": "Angle", "unit": "deg"}}, "node id such as"),
        ("variables", {"angle": {"node": "i=3", "unit": "mm"}}, "must be one of rad, deg, turn"),
        ("variables", {"carriage": {"node": "i=3", "unit": "mm", "scale": 0}}, "must not be 0"),
        ("variables", {"carriage": {"node": "i=3", "unit": "mm", "wraps_at": 9}}, "only the angle"),
        ("commands", {"reset": None}, "commands needs reset"),
        ("commands", {"stop": {"method": "i=3"}}, "object and method, or node and value"),
        ("commands", {"stop": {"node": "i=3", "value": 0.5}}, "true, false or a whole number"),
        ("state", {"names": {"a": "b"}}, "names of state must give a text for each number"),
        ("state", {"faults": 2}, "faults of state must be a list"),
        ("heartbeat", {"read": 3}, "parameter read must be a str, got 3"),
        ("heartbeat", {"write": "Alive"}, "write of heartbeat must be a node id"),
        ("joints", {}, "the file has no parameter joints"),
    ],
)  # fmt: skip
def test_what_cannot_be_used_is_one_sentence(
    section: str, changes: dict[str, Any], sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(MappingError) as refusal:
        parse(tmp_path, **{section: changes})
    assert sentence in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_file_that_is_missing_or_no_yaml_is_named(tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    with pytest.raises(MappingError, match=r"machine\.yaml cannot be read"):
        read_mapping(file)
    file.write_text("server: [", encoding="utf-8")
    with pytest.raises(MappingError, match=r"machine\.yaml: "):
        read_mapping(file)


def test_a_password_comes_from_where_the_mapping_names_it(tmp_path: Path) -> None:
    (tmp_path / "word").write_text("secret\n", encoding="utf-8")
    by_file = parse(tmp_path, server={"user": "me", "password_file": "word"}).server
    assert read_password(by_file, {}) == "secret"
    by_variable = parse(tmp_path, server={"user": "me", "password_variable": "WORD"}).server
    assert read_password(by_variable, {"WORD": "hidden"}) == "hidden"
    with pytest.raises(MappingError, match="WORD, which is not set"):
        read_password(by_variable, {})


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


SERVER = Server(
    endpoint="opc.tcp://plc:4840",
    reconnect_wait_s=0.5,
    reconnect_wait_max_s=3.0,
    stop_after_link_loss_s=2.0,
)


def lost_link() -> Link:
    """Return a link that was up and has been lost at 10 s."""
    link = Link(SERVER, 0.0)
    link.established()
    link.lost(10.0, "cable out")
    return link


def test_attempts_come_ever_slower_and_fast_again_after_a_success() -> None:
    link = Link(SERVER, 0.0)
    assert [link.failed("no route") for _ in range(4)] == [0.5, 1.0, 2.0, 3.0]
    link.established()
    link.lost(1.0, "cable out")
    assert link.failed("no route") == 0.5


def test_a_refusal_names_its_reason_and_since_when() -> None:
    link = lost_link()
    assert link.refuse("start", 12.5) == (
        "the link to the PLC at opc.tcp://plc:4840 has been lost for 2.5 s: cable out"
    )
    link.established()
    assert link.refuse("start", 12.5) == ""


def test_a_machine_is_stopped_after_a_long_loss_only() -> None:
    assert lost_link().stop_on_return(11.9) == ""
    assert lost_link().stop_on_return(12.1) == "stop"
    assert Link(SERVER, 0.0).stop_on_return(100.0) == ""


def test_the_strongest_stop_is_owed_and_paid_once() -> None:
    link = lost_link()
    for command in ("emergency_stop", "start", "stop"):
        link.refuse(command, 10.5)
    assert link.stop_on_return(10.6) == "emergency_stop"
    link.stopped("emergency_stop")
    assert link.stop_on_return(20.0) == ""
    link.established()
    link.lost(20.0, "cable out")
    assert link.stop_on_return(20.1) == ""


def test_a_stop_that_is_asked_for_while_a_weaker_one_is_given_is_owed() -> None:
    link = lost_link()
    assert link.stop_on_return(13.0) == "stop"
    link.refuse("quick_stop", 13.1)
    link.stopped("stop")
    assert link.stop_on_return(13.2) == "quick_stop"


def test_a_plc_program_that_stands_is_reported() -> None:
    watch = HeartbeatWatch(Heartbeat(read="i=1", timeout_s=1.0))
    watch.restart(0.0)
    assert watch.complaint(0.9) == ""
    assert "stood at None for 1.5 s" in watch.complaint(1.5)
    watch.see(7, 2.0)
    watch.see(7, 2.9)
    assert watch.complaint(2.9) == ""
    assert "stood at 7 for 1.1 s, more than 1 s" in watch.complaint(3.1)
    assert HeartbeatWatch(Heartbeat()).complaint(1e6) == ""


def test_the_drivers_counter_fits_a_small_integer() -> None:
    watch = HeartbeatWatch(Heartbeat())
    counts = [watch.advance() for _ in range(2**15 + 1)]
    assert (counts[0], max(counts), counts[-1]) == (1, 2**15 - 1, 1)
