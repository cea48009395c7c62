"""Under which heading of the help an option stands; those without one stand under Options."""

from __future__ import annotations

from collections.abc import Iterator

_MACHINE = "External machine"
_CAMERA = "Camera and markers"
_LAY = "Wanted lay"

# Record of parameters -> heading of the options that it declares.
PANEL_OF_RECORD = {
    "Condition": "What is wound",
    "RunParameters": "What is wound, and how it is computed",
    "MachineAxes": _MACHINE,
    "CameraClockParameters": _CAMERA,
    "MarkerParameters": _CAMERA,
    "MarkerLook": _CAMERA,
    "CameraPlacement": _CAMERA,
    "CameraPixels": _CAMERA,
    "LayParameters": _CAMERA,
    "LayWish": _LAY,
    "LayTolerance": _LAY,
    "ErrorLimit": "What is written",
    "PlanParameters": "Limits of the machine",
}


def _options_of_run() -> Iterator[tuple[str, str]]:
    for panel, names in (
        ("Simulated machine", "lay truth speed frame_rate camera_noise seed"),
        (_MACHINE, "machine camera start turns wound_length_mm standing_s"),
        ("What is written", "output report json bag compression split_mb trace"),
        ("Graph", "compose weights parameters domain namespace attach secure"),
        ("Operator's page", "dashboard dashboard_port"),
    ):
        for name in names.split():
            yield name, panel


# Option of `winding run` -> heading.
PANEL_OF_RUN = dict(_options_of_run())
