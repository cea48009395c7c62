"""Made-up diagnostics: what was promised, or a MessageError and nothing else."""

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from hypothesis import given
from hypothesis import strategies as st
from made_up import any_float, fuzzed, stamps, taken, wired, words

from winding_core.cable.material_report import MaterialReport
from winding_core.status import Level, Status
from winding_ros.messages.diagnostics import (
    NAME,
    decode_case_votes,
    decode_diagnostics,
    decode_material,
    encode_case_votes,
    encode_diagnostics,
    encode_material,
)

pytestmark = pytest.mark.slow


keys = st.one_of(
    words, st.sampled_from(["case 4", "case x", "law", "young", "markers", "taken_up"])
)
values = st.one_of(words, st.sampled_from(["0.5", "nan", "1e999", "-1", "1 2", "9" * 5000]))
statuses = st.lists(
    st.builds(
        lambda level, name, pairs: DiagnosticStatus(
            level=bytes([level]),
            name=name,
            values=[KeyValue(key=key, value=value) for key, value in pairs],
        ),
        st.one_of(st.integers(0, 3), st.integers(0, 255)),
        st.one_of(words, st.just(NAME)),
        st.lists(st.tuples(keys, values), max_size=7),
    ),
    max_size=2,
)


@fuzzed
@given(statuses=statuses)
def test_diagnostics(statuses: list[DiagnosticStatus]) -> None:
    message = wired(DiagnosticArray(status=statuses))
    read = taken(decode_diagnostics, message)
    if read is not None:
        assert {status.level for status in read[1]} <= set(Level)
    votes = taken(decode_case_votes, message)
    if votes is not None:
        assert all(0.0 <= share <= 1.0 for share in votes[1].values())
    taken(decode_material, message)


@fuzzed
@given(
    t=stamps,
    reported=st.lists(
        st.builds(
            Status,
            name=words,
            level=st.sampled_from(Level),
            message=words,
            values=st.dictionaries(words, words, max_size=3),
        ),
        max_size=3,
    ),
)
def test_diagnostics_come_back(t: float, reported: list[Status]) -> None:
    assert decode_diagnostics(wired(encode_diagnostics(t, reported))) == (t, tuple(reported))


@fuzzed
@given(votes=st.dictionaries(st.integers(1, 12), st.integers(0, 10**6).map(lambda k: k / 10**6)))
def test_votes_come_back_best_first(votes: dict[int, float]) -> None:
    _, back = decode_case_votes(encode_case_votes(1.0, votes))
    assert back == votes
    assert list(back.values()) == sorted(votes.values(), reverse=True)


@fuzzed
@given(
    numbers=st.lists(any_float, min_size=4, max_size=4),
    markers=st.lists(st.integers(0, 9), max_size=4),
    taken_up=st.booleans(),
    refusal=words,
)
def test_materials_come_back(
    numbers: list[float], markers: list[int], taken_up: bool, refusal: str
) -> None:
    report = MaterialReport(
        law="linear",
        young=numbers[0],
        standard_error=numbers[1],
        half_width_90=numbers[2],
        markers=tuple(markers),
        worst_share=numbers[3],
        taken_up=taken_up,
        refusal=refusal,
    )
    _, back = decode_material(wired(encode_material(1.0, report)))
    # Unlike nan, its text is equal to itself.
    assert repr(back) == repr(report)
