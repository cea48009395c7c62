"""An identified material on its way through a message."""

import math

import pytest
from diagnostic_msgs.msg import DiagnosticArray

from winding_core.cable.material_report import MaterialReport, refused_material
from winding_core.status import Level, Status
from winding_ros.messages.diagnostics import (
    NAME,
    decode_material,
    encode_diagnostics,
    encode_material,
)
from winding_ros.messages.serialised import MessageError

FOUND = MaterialReport(
    law="linear",
    young=3.1234567890123e6,
    standard_error=2.0e4,
    half_width_90=3.3e4,
    markers=(1, 2),
    worst_share=1.0e-4,
    taken_up=True,
)


def test_report_comes_back_to_the_last_digit() -> None:
    assert decode_material(encode_material(7.5, FOUND)) == (7.5, FOUND)


def test_nothing_identified_yet_comes_back_as_none() -> None:
    assert decode_material(encode_material(0.0, None)) == (0.0, None)


def test_people_read_the_modulus_and_its_half_width() -> None:
    status = encode_material(0.0, FOUND).status[0]
    assert status.message == (
        "effective modulus 3.123 MPa, nine times in ten within 0.033 MPa, from P1, P2"
    )
    assert status.level == bytes([Level.OK])


def test_refusal_is_a_warning_with_its_cause() -> None:
    message = encode_material(1.0, refused_material("linear", (1,), "it is rigid"))
    _, report = decode_material(message)
    assert message.status[0].level == bytes([Level.WARN])
    assert report is not None
    assert report.refusal == "it is rigid"
    assert math.isnan(report.young)


@pytest.mark.parametrize(
    ("message", "sentence"),
    [
        (DiagnosticArray(), "one status named"),
        (encode_diagnostics(0.0, [Status(name="other")]), "one status named"),
        (encode_diagnostics(0.0, [Status(name=NAME, values={"law": "linear"})]), "needs the value"),
        (
            encode_diagnostics(0.0, [Status(name=NAME, values={"law": "x", "young": "soft"})]),
            "young of a material must be a number, got 'soft'",
        ),
    ],
)
def test_other_messages_are_refused(message: DiagnosticArray, sentence: str) -> None:
    with pytest.raises(MessageError, match=sentence):
        decode_material(message)
