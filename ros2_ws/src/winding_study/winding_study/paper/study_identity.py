"""Which study this was, with everything that its cases share."""

from __future__ import annotations

from winding_core.machine.tension import DeadWeight
from winding_core.units import MILLIMETRE
from winding_study.paper.study import ROD_SEGMENT, StudyConfig
from winding_study.paper.study_record import StudyRecord
from winding_study.runs.identity import Identity, Origin, Quantity


def study_identity(record: StudyRecord, origin: Origin, seeds: tuple[int, ...]) -> Identity:
    """Return which study this was.

    Args:
        record: What was found.
        origin: The process that made it.
        seeds: Of the networks; none where no model was trained.
    """
    condition = {
        "cases": Quantity(
            value=", ".join(map(str, record.cases)), label="Cases", meaning="rows of Table 1"
        ),
        "base": Quantity(value=record.who, label="Base", meaning="what predicted the lengths"),
    }
    if record.config is not None:
        condition |= _wound(record.config)
    return Identity(origin=origin, seeds=seeds, condition=condition)


def _wound(config: StudyConfig) -> dict[str, Quantity]:
    drive = config.drive
    return {
        "element": Quantity(value=config.element, label="Element", meaning="finite element"),
        "law": Quantity(value=config.law, label="Law", meaning="material law"),
        "segment_mm": _element_length(config),
        "mass_scaling": Quantity(
            value=config.scaling, label="Mass scaling", meaning="factor on the density"
        ),
        "free_length_mm": Quantity(
            value=config.free_length / MILLIMETRE,
            unit="mm",
            label="Free length",
            meaning="tangent span between cylinder and guide",
        ),
        "tension": Quantity(
            value="dead weight" if isinstance(config.tension_law, DeadWeight) else "rig",
            label="Span tension",
            meaning="what pulls the span",
        ),
        "omega_rad_s": Quantity(
            value=drive.angular_speed,
            unit="rad/s",
            label="Cylinder speed",
            meaning="cylinder speed after the ramp",
        ),
        "feed_mm_s": Quantity(
            value=drive.feed_speed / MILLIMETRE,
            unit="mm/s",
            label="Carriage speed",
            meaning="carriage speed after the ramp",
        ),
        "ramp_time_s": Quantity(
            value=drive.ramp_time, unit="s", label="Ramp time", meaning="time of the speed ramp"
        ),
        "duration_s": Quantity(
            value=config.duration, unit="s", label="Duration", meaning="simulated length of a run"
        ),
    }


def _element_length(config: StudyConfig) -> Quantity:
    label, meaning = "Element length", "reference length of an element"
    if config.segment_length is None and config.element == "solid":
        return Quantity(value="a sixth of the cylinder's diameter", label=label, meaning=meaning)
    length = config.segment_length or ROD_SEGMENT
    return Quantity(value=length / MILLIMETRE, unit="mm", label=label, meaning=meaning)
