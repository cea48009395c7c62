"""An identified material as DiagnosticArray, and back."""

from __future__ import annotations

from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticArray

from winding_core.cable.material_report import NAME, MaterialReport
from winding_core.status import Level, Status
from winding_ros.diagnostic_messages import decode_diagnostics, encode_diagnostics
from winding_ros.message_error import MessageError


def encode_material(t: float, report: MaterialReport | None) -> DiagnosticArray:
    """Return a report as a message stamped t [s]; None says that nothing is identified yet."""
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
