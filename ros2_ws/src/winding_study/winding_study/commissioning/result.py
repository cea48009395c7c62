"""What a commissioning run leaves: a cable file, a cell file, its numbers, and words."""

import dataclasses
import math
from collections.abc import Iterator, Sequence
from typing import Any

from cable_fem_node.identification import RigPosterior
from winding_core.catalogue.cables import PROPERTIES, Cable, check_cable
from winding_core.run_spec import RunSpec
from winding_core.units import MEGAPASCAL, MILLIMETRE, json_values
from winding_study.commissioning.design import Expected

# Number -> option of a cell file and one of its units in SI.
_CELL_OPTIONS = {
    "free_length": ("free_length_mm", MILLIMETRE),
    "friction": ("friction", 1.0),
    "load_share": ("tension_share", 1.0),
    "guide_drag": ("tension_offset_n", 1.0),
    "start_share": ("tension_start_share", 1.0),
    "build_up_length": ("tension_build_up_mm", MILLIMETRE),
}
# What stands for one of them, or follows from it.
_REPLACED = {"guide_distance_mm", "tension_diameter_gain_n", "tension_reference_diameter_mm"}
# A motion of the commissioning alone.
_OF_THE_RUN = {"omega_rad_s", "feed_mm_s", "duration_s", "turns", "output", "bag", "lay"}


def cable_of(name: str, spec: RunSpec, posterior: RigPosterior, source: str) -> Cable:
    """Return the cable that was found, at the best numbers, whose deviations belong to it.

    Args:
        name: Of the cable.
        spec: The run, with what was known of the cable.
        posterior: What was found.
        source: Where the data are from.
    """
    condition = spec.condition.resolved()
    best = posterior.best
    material = condition.case.material
    properties: dict[str, Any] = {
        "cable_diameter_mm": round(condition.case.cable_diameter / MILLIMETRE, 9),
        "young_mpa": _rounded(float(best["young"][0]) / MEGAPASCAL),
        "poisson": material.poisson,
        "density": material.density,
        "law": condition.law,
    }
    properties |= {
        key: spec.given[key] for key in PROPERTIES if key in spec.given and key not in properties
    }
    uncertainty = {"young_mpa": _rounded(posterior.beliefs["young"].deviation / MEGAPASCAL)}
    share = float(best["law_share"][0])
    if share > 0.0:
        properties |= {"law": "mooney_rivlin", "mooney_ratio": _rounded(share / (1.0 - share))}
        deviation = posterior.beliefs["law_share"].deviation / (1.0 - share) ** 2
        uncertainty["mooney_ratio"] = _rounded(deviation)
    return check_cable(
        Cable(
            name=name,
            title=name,
            source=source,
            note="the uncertainty of young_mpa is mostly that of the load share: see the cell file",
            properties=properties,
            uncertainty=uncertainty,
            sources=dict.fromkeys(uncertainty, source),
        )
    )


def cell_text_of(spec: RunSpec, posterior: RigPosterior, cable_file: str, source: str) -> str:
    """Return the cell file that was found; its head has every number with its 90 % interval.

    Args:
        spec: The run as it was asked for, without the motion that was chosen.
        posterior: What was found.
        cable_file: Of the cable that was found.
        source: Where the data are from.
    """
    best = posterior.best
    given = {
        key: value
        for key, value in spec.given.items()
        if key not in _REPLACED | _OF_THE_RUN and key not in PROPERTIES
    }
    found = {
        option: _rounded(float(best[name][0]) / unit)
        for name, (option, unit) in _CELL_OPTIONS.items()
    }
    made = RunSpec.from_cell(None, {**given, **found, "cable": cable_file})
    head = [f"# {source}", "# 90 % intervals, and what the run left unknown:"]
    head += [f"# {line}" for line in number_lines(posterior)]
    # The cable is the file's, not what was configured of it.
    own = {key: value for key, value in made.given.items() if key not in PROPERTIES}
    return "\n".join(head) + "\n" + dataclasses.replace(made, given=own).text()


def number_lines(posterior: RigPosterior) -> Iterator[str]:
    """Yield every number with its interval, or that it is unobservable."""
    for item in posterior.found:
        low, high = item.low / item.unit, item.high / item.unit
        line = f"{item.words}: {item.mean / item.unit:.4g}, {low:.4g} to {high:.4g}"
        if not item.observed:
            line += " (unobservable: as wide as before the run)"
        yield line


def remarks(posterior: RigPosterior, following: Sequence[Expected]) -> Iterator[str]:
    """Yield what stays unknown, why, and the most informative next run."""
    yield from posterior.remarks()
    yield (
        "markers determine modulus, load share and drag by their ratios alone: a tensile test or a "
        "load cell at the cylinder tells the modulus itself, no run does"
    )
    if following:
        best = following[0]
        share = best.share[best.most]
        words = posterior.beliefs[best.most].words
        yield (
            f"the next run that tells most, {best.gain:.2g} nat: {best.motion.sentence}; it "
            f"narrows {words.split(',')[0]} to {share:.0%} of what is known now"
        )


def commissioning_record(
    posterior: RigPosterior, design: Sequence[Expected], following: Sequence[Expected]
) -> dict[str, Any]:
    """Return everything that was found as JSON values, SI units."""
    return {
        "numbers": {
            item.name: {**dataclasses.asdict(item), "observed": item.observed}
            for item in posterior.found
        },
        "names": list(posterior.names),
        "best": [float(posterior.best[name][0]) for name in posterior.names],
        "covariance": posterior.covariance.tolist(),
        "unobservable": list(posterior.unobservable),
        **json_values(posterior, "chi_square", "measured", "misfit", "scatter_m"),
        "design": [expected_record(item) for item in design],
        "next": [expected_record(item) for item in following],
    }


def expected_record(item: Expected) -> dict[str, Any]:
    """Return the expected information of a motion as JSON values, SI units."""
    motion = item.motion
    return {
        "gain_nat": item.gain,
        "markers": item.markers,
        **json_values(motion.drive, "angular_speed", "feed_speed"),
        "duration_s": motion.duration,
        "pull": {"angle_rad": list(motion.angles), "newton": list(motion.pulls)},
        "deviation_over_prior": dict(item.share),
    }


def _rounded(value: float) -> float:
    """Return a value to six digits, as a file shows it."""
    return 0.0 if value == 0.0 else round(value, 5 - math.floor(math.log10(abs(value))))
