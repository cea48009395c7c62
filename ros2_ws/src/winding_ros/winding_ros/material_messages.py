"""An identified material as DiagnosticArray, and back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray

from winding_core.status import Level, Status
from winding_ros.diagnostic_messages import decode_diagnostics, encode_diagnostics
from winding_ros.rig_messages import MessageError

NAME = "cable_fem: material"


@dataclass(frozen=True, kw_only=True)
class MaterialReport:
    """What a run's markers say of its cable.

    Attributes:
        law: Material law that was fitted.
        young: Effective Young's modulus [Pa]; nan where there is none.
        standard_error: [Pa]
        half_width_90: The modulus lies within this nine times in ten [Pa].
        markers: Numbers of the markers used.
        worst_share: Greatest miss of an angle, relative to the angle.
        taken_up: Whether model and prediction go on with it.
        refusal: Why it must not be used; empty where it may be.
    """

    law: str
    young: float
    standard_error: float
    half_width_90: float
    markers: tuple[int, ...]
    worst_share: float
    taken_up: bool
    refusal: str = ""

    def status(self) -> Status:
        """Return the report as a component's state."""
        return Status(
            name=NAME,
            level=Level.WARN if self.refusal else Level.OK,
            message=self.refusal or self._message(),
            values={
                "law": self.law,
                "young": repr(self.young),
                "standard_error": repr(self.standard_error),
                "half_width_90": repr(self.half_width_90),
                "markers": " ".join(map(str, self.markers)),
                "worst_share": repr(self.worst_share),
                "taken_up": "yes" if self.taken_up else "no",
            },
        )

    def _message(self) -> str:
        numbers = ", ".join(f"P{marker}" for marker in self.markers)
        return (
            f"effective modulus {self.young / 1e6:.3f} MPa, nine times in ten within "
            f"{self.half_width_90 / 1e6:.3f} MPa, from {numbers}"
        )


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


def refused_material(law: str, markers: tuple[int, ...], refusal: str) -> MaterialReport:
    """Return the report of an identification that found nothing."""
    return MaterialReport(
        law=law,
        young=math.nan,
        standard_error=math.nan,
        half_width_90=math.nan,
        markers=markers,
        worst_share=math.nan,
        taken_up=False,
        refusal=refusal,
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
