"""Hidden cells that the rod winds, commissioned in one process: coverage, widths, the next run.

A cell is drawn from the prior. The rod winds it with finer elements than the fit has, under the
tension of the hidden machine; what a tracker would measure of it has the errors of `CameraErrors`.
"""

import dataclasses
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cable_fem_node.dynamics.state import SolverError
from cable_fem_node.identification import (
    IdentificationError,
    Readings,
    RigPosterior,
    RigPrior,
    TrackedRun,
    identify_rig,
)
from cable_fem_node.identification.rig import Numbers, numbers_of, opened, unknowns_of, with_ratios
from cable_fem_node.identification.rig_lay import RigLay
from cable_fem_node.identification.rig_rod import rod_places, rod_run
from cable_fem_node.winding.rig_prior import CELL
from cable_fem_node.winding.rod_winding import RodWinding
from cable_fem_node.winding.run_ahead import replay
from cable_fem_node.winding.winding_config import SolverParameters, WindingConfig
from winding_core.cable.condition import Condition
from winding_core.helix import curve_length
from winding_core.markers import is_wound
from winding_study.commissioning.design import SEEN_AFTER, ranked
from winding_study.commissioning.motion import (
    LONGEST,
    MOST_BENT,
    MOST_STRESSED,
    MachineReach,
    Motion,
    candidates,
    safe_pulls,
)
from winding_verification.closed_loop.run import CameraErrors

Array = NDArray[np.float64]

_FINER = 0.8  # Elements of the hidden cell over those of the fit
# A marker that moves so far after it was first seen counts as slipped, and is not used [rad].
_SLIPPED = 8.0e-3
_LOAD_CELL = 0.01  # Noise of a reading of the pull [N]
_PIECE = 40  # Samples between two looks at the markers
_TRAVEL = 0.3  # Of the carriage [m]
# The next run pulls and feeds by these shares of the condition's weight and feed, so long [s].
_NEXT_PULL, _NEXT_FEED, _NEXT_DURATION = 0.8, 0.7, 20.0
_MARKERS = 40
_DRAWS, _POSTERIOR = 200, 1500
# Bending's share of the tension at the start beyond which the rod does not hold to a percent.
_MOST_BENT_AT_START = 0.3
# One cell in so many has a motion law, a feed and a camera of its own.
_OWN_EVERY, _OWN_AT = 20, 13
_OWN_SPEED, _OWN_RAMP, _OWN_FEED, _OWN_CAMERA = 1.3, 2.5, 6.0e-3, 2.0


@dataclass(frozen=True, kw_only=True)
class CommissionedCell:
    """What came of one hidden cell."""

    seed: int  # Of everything hidden
    case: int  # Row of Table 1
    motion: str  # That was chosen
    hidden: dict[str, float]  # By name
    commissioned: RigPosterior  # After the chosen run
    plain: RigPosterior | None  # After a run of the same length as in the paper
    missed: Array  # Of the next run's lengths, relative, shape (m,)
    cpu: float  # Of design and fit [s]


def commissioned_cell(seed: int, *, plain: bool = True) -> CommissionedCell:
    """Draw a cell, choose a motion, wind, identify, and predict another run.

    Args:
        seed: Of cell and noise; its case is 1 + seed mod 12. Of 13, 33, ... ramp, speeds and
            errors of the camera are others than those of the twelve cases.
        plain: Whether a run as in the paper, of the longest duration, is identified beside it.

    Raises:
        IdentificationError: No cell that was drawn can be wound.
    """
    rng = np.random.default_rng((seed, 31))
    case = 1 + seed % 12
    what = Condition(case=case, law="neo_hookean", markers=_MARKERS).resolved()
    config = SolverParameters().config_of(what)
    prior, weight = CELL, what.case.weight
    drive, feed, errors = what.drive, None, CameraErrors()
    if seed % _OWN_EVERY == _OWN_AT:
        feed = _OWN_FEED
        drive = dataclasses.replace(drive, angular_speed=_OWN_SPEED, ramp_time=_OWN_RAMP)
        errors = CameraErrors(
            **{name: _OWN_CAMERA * value for name, value in dataclasses.asdict(errors).items()}
        )
    reach = MachineReach(
        speeds=(drive.angular_speed, drive.angular_speed),
        carriage_speed=0.08,
        feed=feed,
        travel=_TRAVEL,
        weight=weight,
        pulls=safe_pulls(what.case, prior, (0.3 * weight, 1.5 * weight)),
        ramp_time=drive.ramp_time,
    )
    began = time.process_time()
    chosen = ranked(config, candidates(reach), prior)[0].motion
    cpu = time.process_time() - began
    paper = Motion(name="even", drive=drive, duration=LONGEST, pulls=(weight,))
    following = Motion(
        name="even",
        drive=dataclasses.replace(drive, feed_speed=_NEXT_FEED * drive.feed_speed),
        duration=_NEXT_DURATION,
        pulls=(_NEXT_PULL * weight,),
    )
    for _ in range(_DRAWS):
        hidden = _drawn(config, prior, rng)
        if not _holds(config, hidden, (*chosen.pulls, *paper.pulls, *following.pulls)):
            continue
        wound = (chosen, paper, following) if plain else (chosen, following)
        try:
            runs = [_measured(config, motion, hidden, rng, errors) for motion in wound]
            break
        except (SolverError, ValueError):
            # A cell that tears its cable is none.
            continue
    else:
        raise IdentificationError(f"seed {seed}: no cell of {_DRAWS} can be wound")
    began = time.process_time()
    commissioned = identify_rig([runs[0][0]], prior, draws=_POSTERIOR)
    cpu += time.process_time() - began
    lay = RigLay(config, following.inputs(), commanded=following.commanded)
    theta, z = rod_places(lay, commissioned.best)
    used, truth = runs[-1][0].readings.ids - 1, runs[-1][1]
    radius = what.case.centreline_radius
    predicted = curve_length(radius, theta[used], z[used])
    return CommissionedCell(
        seed=seed,
        case=case,
        motion=chosen.sentence,
        hidden={name: float(value[0]) for name, value in hidden.items()},
        commissioned=commissioned,
        plain=identify_rig([runs[1][0]], prior, draws=_POSTERIOR) if plain else None,
        missed=np.asarray(predicted) / curve_length(radius, truth[0], truth[1]) - 1.0,
        cpu=cpu,
    )


def _drawn(config: WindingConfig, prior: RigPrior, rng: np.random.Generator) -> Numbers:
    unknowns = unknowns_of(prior, config)
    hidden = numbers_of(unknowns, rng.standard_normal((1, len(opened(unknowns)))))
    if rng.random() < prior.steady:
        hidden["start_share"] = np.ones(1)
    return with_ratios(hidden)


def _holds(config: WindingConfig, hidden: Numbers, pulls: tuple[float, ...]) -> bool:
    """Return whether the solver holds for a cell, as for the hidden rigs of the identification."""
    case, number = config.case, {name: float(value[0]) for name, value in hidden.items()}
    low, high = (number["load_share"] * end(pulls) + number["guide_drag"] for end in (min, max))
    bent = case.bending_stiffness * number["young"] / case.material.young
    bent /= 2.0 * case.centreline_radius**2 * low
    return (
        high <= MOST_STRESSED * number["young"] * case.axial_area
        and bent < MOST_BENT
        and bent / number["start_share"] < _MOST_BENT_AT_START
    )


def _measured(
    config: WindingConfig,
    motion: Motion,
    hidden: Numbers,
    rng: np.random.Generator,
    errors: CameraErrors,
) -> tuple[TrackedRun, tuple[Array, Array]]:
    """Return what the run leaves, and where the used markers truly lie, shape (m,) each.

    Raises:
        SolverError, ValueError: The cable cannot be wound, or no marker lands.
    """
    wound, inputs = rod_run(RigLay(config, motion.inputs(), commanded=motion.commanded), hidden)
    wound = dataclasses.replace(wound, segment_length=_FINER * wound.resolved.segment)
    inputs = inputs[inputs["t"] <= motion.duration]
    # The eye stands beside its place on the carriage from the first turn on.
    eye = float(hidden["eye"][0])
    inputs["carriage_position"] += eye * np.minimum(inputs["cylinder_angle"] / 0.5, 1.0)
    model = RodWinding(wound)
    first = np.full(config.case.marker_count, np.nan)
    for begin in range(0, inputs.size, _PIECE):
        replay(inputs[begin : begin + _PIECE], model)
        rows = model.markers()[1:]
        seen = is_wound(rows) & (rows["theta"] < model.cylinder_angle - SEEN_AFTER)
        new = seen & np.isnan(first)
        first[new] = rows["theta"][new]
    rows = model.markers()[1:]
    kept = np.isfinite(first) & (np.abs(rows["theta"] - first) < _SLIPPED)
    theta, z = (np.asarray(rows[name][kept], dtype=float) for name in ("theta", "z"))
    z = z * (1.0 + float(hidden["camera_scale"][0]))
    count = theta.size
    sigma_z = np.hypot(errors.marker_z, 2.0e-5)
    readings = Readings(
        ids=np.flatnonzero(kept).astype(np.int64) + 1,
        theta=theta + errors.marker_theta * rng.standard_normal(count),
        z=z + errors.common_z * rng.standard_normal() + sigma_z * rng.standard_normal(count),
        sigma_theta=np.full(count, errors.marker_theta),
        sigma_z=np.full(count, sigma_z),
    )
    seen_inputs = motion.inputs()
    seen_inputs["tension"] += _LOAD_CELL * rng.standard_normal(seen_inputs.size)
    run = TrackedRun(
        config=config, inputs=seen_inputs, readings=readings, commanded=motion.commanded
    )
    return run, (theta, z)


def study_text(cells: list[CommissionedCell], refused: list[int]) -> str:
    """Return coverage by number, widths beside the plain run's, the next run, and the time."""
    lines = [f"{len(cells)} hidden cells, seeds {[cell.seed for cell in cells]}"]
    lines += [f"not identified, with a reason: seeds {refused}"]
    inside_all: list[bool] = []
    for item in cells[0].commissioned.found:
        name = item.name
        if name not in cells[0].hidden:
            continue
        found = [cell.commissioned.beliefs[name] for cell in cells]
        inside = [
            one.low <= cell.hidden[name] <= one.high for cell, one in zip(cells, found, strict=True)
        ]
        inside_all += inside
        share = [one.deviation / one.prior_deviation for one in found]
        # A tension that is steady beyond doubt has a start share without a deviation.
        off = [
            (cell.hidden[name] - one.mean) / one.deviation
            for cell, one in zip(cells, found, strict=True)
            if one.deviation > 0.0
        ] or [0.0]
        line = (
            f"{name:16s} inside 90 %: {sum(inside)} of {len(inside)}; errors in deviations: mean "
            f"{np.mean(off):.2f}, root mean square {np.sqrt(np.mean(np.square(off))):.2f}, at most "
            f"{np.max(np.abs(off)):.1f}; deviation over the prior's: median "
            f"{np.median(share):.3f}; unobservable in "
            f"{np.mean([not one.observed for one in found]):.0%}"
        )
        ratio = [
            one.half_width_90 / cell.plain.beliefs[name].half_width_90
            for cell, one in zip(cells, found, strict=True)
            if cell.plain is not None and cell.plain.beliefs[name].half_width_90 > 0.0
        ]
        if ratio:
            line += (
                f"; half width over the plain run's: median {np.median(ratio):.2f}, at most "
                f"{np.max(ratio):.2f}"
            )
        lines.append(line)
    missed = np.abs(np.concatenate([cell.missed for cell in cells]))
    lines += [
        f"all numbers: {np.mean(inside_all):.1%} inside their 90 % intervals",
        f"next run: {missed.size} markers, {np.mean(missed < 0.005):.1%} within 0.5 %, "
        f"median {np.median(missed):.3%}, at most {missed.max():.2%}",
        f"misfits: {sum(cell.commissioned.misfit for cell in cells)}",
        f"CPU of design and fit: mean {np.mean([cell.cpu for cell in cells]):.1f} s, at most "
        f"{max(cell.cpu for cell in cells):.1f} s",
    ]
    return "\n".join(lines)
