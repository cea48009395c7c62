"""What `winding identify --rig` has to say: for people, and as JSON."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from rich.table import Table

from winding_core.helix import curve_length
from winding_core.units import MEGAPASCAL, MILLIMETRE

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from rich.console import Console

    from cable_fem_node.identification import RigPosterior, TrackedRun

# Name, what people read, and one printed unit in SI.
_SHOWN = (
    ("young", "E, MPa", MEGAPASCAL),
    ("effective_young", "E under the stated tension, MPa", MEGAPASCAL),
    ("free_length", "free length, mm", MILLIMETRE),
    ("load_share", "load share", 1.0),
    ("guide_drag", "guide drag, N", 1.0),
    ("start_share", "share of the tension at the start", 1.0),
    ("build_up_length", "build-up length, mm", MILLIMETRE),
)
_READ = {name: title.split(",")[0] for name, title, _ in _SHOWN}


def rig_record(posterior: RigPosterior, runs: Sequence[TrackedRun]) -> dict[str, Any]:
    """Return the posterior as JSON, SI units.

    Args:
        posterior: Of the runs' first markers.
        runs: With all markers that were measured.
    """
    return {
        "rig": {
            name: dataclasses.asdict(belief)
            | {"half_width_90": belief.half_width_90, "told": belief.observed}
            for name, belief in posterior.beliefs.items()
        },
        "names": list(posterior.names),
        "covariance": posterior.covariance.tolist(),
        "correlation": posterior.correlation.tolist(),
        "steady_probability": posterior.steady,
        "untold": list(posterior.untold),
        "chi_square": posterior.chi_square,
        "measured": posterior.measured,
        "misfit": posterior.misfit,
        "scatter_m": posterior.scatter,
        "worst_share": posterior.worst_share,
        "predicted": list(_ahead(posterior, runs)),
        "refused": posterior.refusal(),
    }


def print_rig(console: Console, record: dict[str, Any]) -> None:
    """Print what `rig_record` returned."""
    table = Table(title="The rig; nine times in ten between low and high")
    for heading in ("", "mean", "deviation", "low", "high", "before", "told by the markers"):
        table.add_column(heading, justify="left" if not heading else "right")
    for name, title, unit in _SHOWN:
        belief = record["rig"][name]
        table.add_row(
            title,
            *(
                f"{belief[key] / unit:.4g}"
                for key in ("mean", "deviation", "low", "high", "prior_deviation")
            ),
            "known" if belief["prior_deviation"] == 0.0 else ("yes" if belief["told"] else "no"),
        )
    console.print(table)
    for sentence in _remarks(record):
        console.print(sentence, highlight=False)
    if record["predicted"]:
        console.print(_ahead_table(record["predicted"]))


def _remarks(record: dict[str, Any]) -> Iterator[str]:
    yield (
        f"probability that the tension does not build up: {record['steady_probability']:.0%}; "
        f"sum of squares {record['chi_square']:.3g} of {record['measured']} numbers"
    )
    if record["untold"]:
        names = ", ".join(_READ[name] for name in record["untold"])
        yield f"the markers do not tell, so that it is what was stated before: {names}"
    if record["misfit"]:
        yield (
            "the markers contradict model and tracker: each was given a scatter of "
            f"{record['scatter_m'] / MILLIMETRE:.2g} mm, and the widths say so"
        )


def _ahead(posterior: RigPosterior, runs: Sequence[TrackedRun]) -> Iterator[dict[str, Any]]:
    for number, (run, markers) in enumerate(zip(runs, posterior.ahead, strict=True)):
        readings, radius = run.readings, run.config.case.centreline_radius
        lengths = curve_length(radius, readings.theta, readings.z).tolist()
        measured = dict(zip(readings.ids.tolist(), lengths, strict=True))
        for marker in markers:
            known = measured.get(marker.id)
            yield {
                "run": number,
                "id": marker.id,
                "theta_rad": marker.theta,
                "sigma_theta_rad": marker.sigma_theta,
                "z_m": marker.z,
                "sigma_z_m": marker.sigma_z,
                "s_m": marker.s,
                "half_width_90_m": marker.half_width_90,
                "s_measured_m": known,
                "error_pct": None if known is None else 100.0 * abs(known / marker.s - 1.0),
            }


def _ahead_table(rows: Sequence[dict[str, Any]]) -> Table:
    table = Table(title="Remaining markers")
    for heading in (
        "run",
        "marker",
        "theta, rad",
        "z, mm",
        "S, mm",
        "within, mm",
        "measured S, mm",
        "error, %",
    ):
        table.add_column(heading, justify="right")
    for row in rows:
        known = row["s_measured_m"]
        table.add_row(
            str(row["run"] + 1),
            f"P{row['id']}",
            f"{row['theta_rad']:.3f}",
            f"{row['z_m'] / MILLIMETRE:.2f}",
            f"{row['s_m'] / MILLIMETRE:.2f}",
            f"{row['half_width_90_m'] / MILLIMETRE:.2f}",
            "-" if known is None else f"{known / MILLIMETRE:.2f}",
            "-" if known is None else f"{row['error_pct']:.2f}",
        )
    return table
