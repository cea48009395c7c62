"""Node states, case votes and a material as DiagnosticArray (REP-107), and back."""

from collections.abc import Mapping, Sequence

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from winding_core.cable.material_report import NAME, MaterialReport
from winding_core.status import Level, Status
from winding_ros.messages.serialised import MessageError
from winding_ros.messages.stamps import decode_stamp, encode_stamp


def encode_diagnostics(
    t: float, statuses: Sequence[Status], hardware_id: str = ""
) -> DiagnosticArray:
    """Return statuses as a DiagnosticArray stamped t [s]."""
    message = DiagnosticArray()
    message.header.stamp = encode_stamp(t)
    message.status = [
        DiagnosticStatus(
            level=bytes([status.level]),
            name=status.name,
            message=status.message,
            hardware_id=hardware_id,
            values=[KeyValue(key=key, value=value) for key, value in status.values.items()],
        )
        for status in statuses
    ]
    return message


def decode_diagnostics(message: DiagnosticArray) -> tuple[float, tuple[Status, ...]]:
    """Return (t [s], statuses).

    Raises:
        MessageError: A level is none of REP-107's.
    """
    for status in message.status:
        if status.level[0] not in set(Level):
            raise MessageError(f"status {status.name!r} has the unknown level {status.level[0]}")
    statuses = tuple(
        Status(
            name=status.name,
            level=Level(status.level[0]),
            message=status.message,
            values={item.key: item.value for item in status.values},
        )
        for status in message.status
    )
    return decode_stamp(message.header.stamp), statuses


def encode_case_votes(t: float, votes: Mapping[int, float]) -> DiagnosticArray:
    """Return the share of votes of each known case, best first, as a DiagnosticArray.

    No votes mean that nothing has been measured yet.
    """
    ranked = sorted(votes.items(), key=lambda item: (-item[1], item[0]))
    message = "no marker is measured yet"
    if ranked:
        message = f"resembles case {ranked[0][0]} with {ranked[0][1]:.0%} of the votes"
    return encode_diagnostics(
        t,
        [
            Status(
                name="correction: case",
                message=message,
                values={f"case {number}": f"{vote:.6f}" for number, vote in ranked},
            )
        ],
    )


def decode_case_votes(message: DiagnosticArray) -> tuple[float, dict[int, float]]:
    """Return (t [s], share of votes by case number), best first.

    Raises:
        MessageError: It is not one status with a share, 0 to 1, for each case.
    """
    t, statuses = decode_diagnostics(message)
    if len(statuses) != 1:
        raise MessageError(f"case votes need one status, got {len(statuses)}")
    shares = statuses[0].values
    try:
        votes = {int(key.removeprefix("case ")): float(vote) for key, vote in shares.items()}
    except ValueError:
        raise MessageError(f"case votes need a number for each case, got {dict(shares)}") from None
    if not all(0.0 <= vote <= 1.0 for vote in votes.values()):
        raise MessageError(f"a share of votes lies in 0 to 1, got {dict(shares)}")
    return t, votes


def encode_material(t: float, report: MaterialReport | None) -> DiagnosticArray:
    """Return a report as a message stamped t [s]; None where nothing is identified yet."""
    if report is None:
        return encode_diagnostics(t, [Status(name=NAME, message="no marker is measured yet")])
    return encode_diagnostics(t, [report.status()])


def decode_material(message: DiagnosticArray) -> tuple[float, MaterialReport | None]:
    """Return (t [s], report, or None while nothing is identified).

    Raises:
        MessageError: The message is not one of `encode_material`.
    """
    t, statuses = decode_diagnostics(message)
    if len(statuses) != 1 or statuses[0].name != NAME:
        raise MessageError(f"a material is one status named {NAME!r}")
    (status,) = statuses
    if not status.values:
        return t, None
    return t, MaterialReport(
        law=_text(status.values, "law"),
        young=_number(status.values, "young"),
        standard_error=_number(status.values, "standard_error"),
        half_width_90=_number(status.values, "half_width_90"),
        markers=_markers(status.values),
        worst_share=_number(status.values, "worst_share"),
        taken_up=_text(status.values, "taken_up") == "yes",
        refusal=status.message if status.level is not Level.OK else "",
    )


def _text(values: Mapping[str, str], key: str) -> str:
    if key not in values:
        raise MessageError(f"a material needs the value {key}")
    return values[key]


def _number(values: Mapping[str, str], key: str) -> float:
    text = _text(values, key)
    try:
        return float(text)
    except ValueError:
        raise MessageError(f"{key} of a material must be a number, got {text!r}") from None


def _markers(values: Mapping[str, str]) -> tuple[int, ...]:
    text = _text(values, "markers")
    try:
        return tuple(int(part) for part in text.split())
    except ValueError:
        raise MessageError(f"markers of a material must be numbers, got {text!r}") from None
