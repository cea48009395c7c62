"""DEFORM's cables: fitted on their training runs, judged by its loss on the held-out ones."""

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from cable_fem_node.dynamics.state import DivergenceError, FloatArray
from winding_verification.experiments.motion_capture import FRAME_TIME, CapturedCable
from winding_verification.experiments.scenario import ExternalFileError, ExternalRow
from winding_verification.rod.rod import Rod, RodSection

GRAVITY = (0.0, 0.0, -9.81)
# Motions alone are measured, so that every stiffness counts by mass and the density is free.
_DENSITY = 1.0e3
# Of axial waves [m/s]: by its own weight a cable of a metre stretches by 0.05 %.
_WAVE_SPEED = 100.0
_POISSON = 0.43
# The least step is not to be that of twist, which stays faster than any swing.
_SPIN_INERTIA = 20.0
_ROUNDS = 20  # of moving nodes until the gaps between them are right


@dataclass(frozen=True, kw_only=True)
class HeldCable:
    """What a cable is, by its mass."""

    bending: float  # EI / (rho A) [m^4/s^2]
    viscosity: float  # Of bending [s]
    drag: float  # Of the air [1/s]
    # Unstressed curvature about the horizontal y axis and across it, at the start's clamp and
    # evenly along the cable, two numbers [1/m].
    natural: tuple[float, float]
    own: float  # Share of the first frame's shape beyond `natural` that is unstressed, 0 to 1


def predict(run: FloatArray, gaps: FloatArray, cable: HeldCable) -> FloatArray:
    """Return where the markers of a run go, (frames, markers, 3) [m].

    Nodes are the free markers and the inner gripped ones; a clamp points along the two gripped
    markers of its end and does not spin about them. The first two frames give places and
    velocities; of the later ones only gripped markers are used.

    Args:
        run: (frames, markers, 3) [m].
        gaps: Unstressed lengths between the markers (markers - 1,) [m].
        cable: What it is.

    Raises:
        SolverError: The rod diverged.
    """
    rod = _placed(run, gaps, cable)
    first, last = run[:, 1] - run[:, 0], run[:, -1] - run[:, -2]
    end = rod.mass.size - 1
    place = rod.points.position
    found = run.copy()
    for frame in range(2, run.shape[0]):
        rod.drive(0, (run[frame, 1] - place[:, 0]) / FRAME_TIME)
        rod.drive(end, (run[frame, -2] - place[:, end]) / FRAME_TIME)
        rod.aim("start", first[frame])
        rod.aim("end", last[frame])
        rod.advance(FRAME_TIME)
        found[frame, 2:-2] = place.T[1:-1]
    return found


def loss(found: FloatArray, run: FloatArray) -> float:
    """Return DEFORM's loss [m]: mean of |x - x_measured| over coordinates, markers and frames.

    All markers count, the gripped ones with nothing, and all frames behind the first two.
    """
    return float(np.abs(found[2:] - run[2:]).mean())


def _placed(run: FloatArray, gaps: FloatArray, cable: HeldCable) -> Rod:
    reference = gaps[1:-1]
    start, end = run[1, 1] - run[1, 0], run[1, -1] - run[1, -2]
    section = RodSection(
        diameter=4.0 * math.sqrt(cable.bending) / _WAVE_SPEED,
        young=_DENSITY * _WAVE_SPEED**2,
        poisson=_POISSON,
        density=_DENSITY,
    )
    rod = Rod(_with_gaps(run[1, 1:-1], reference), section, reference=reference, twist=True)
    rod.spin_inertia[:] *= _SPIN_INERTIA
    rod.clamp("start", start)
    rod.clamp("end", end)
    rod.gravity[:] = GRAVITY
    rod.damping_rate, rod.viscosity = cable.drag, cable.viscosity
    first, second = rod.directors()
    about_y = math.atan2(second[1, 0], first[1, 0])
    c, s = math.cos(about_y), math.sin(about_y)
    along, across = cable.natural
    rod.natural[0] = rod.voronoi * (s * along + c * across)
    rod.natural[1] = rod.voronoi * (s * across - c * along)
    rod.natural[:2] += cable.own * shape_of_its_own(rod)
    rod.set_velocities((run[1] - run[0])[1:-1] / FRAME_TIME)
    return rod


def _with_gaps(nodes: FloatArray, gaps: FloatArray) -> FloatArray:
    """Return nodes that are moved as little as their gaps need; the ends stay."""
    place = nodes.copy()
    last = gaps.size - 1
    for _ in range(_ROUNDS):
        for i, gap in enumerate(gaps):
            edge = place[i + 1] - place[i]
            step = (1.0 - gap / np.linalg.norm(edge)) * edge
            front, back = (i > 0), (i < last)
            place[i] += front * step / (front + back)
            place[i + 1] -= back * step / (front + back)
    return place


# How far a cable's inertia may stand in for gravity [m/s^2], against a curvature [1/m].
_ACCELERATION, _CURVATURE = 3.0, 1.0


def shape_of_its_own(rod: Rod) -> FloatArray:
    """Return integrated curvatures (2, n) [rad] that no moment explains, beyond the natural ones.

    Bending moments along a cable follow from force and moment at its start, from its weight and
    from its acceleration, here the same everywhere:

        M(s) = M0 - (x - x0) x F0 + int t x (g - a) rho A s ds.

    M0, F0 and a are those that leave the least curvature besides; what they leave is returned.

    Args:
        rod: Framed, clamped at both ends, with gravity and its natural curvature.
    """
    place = rod.nodes
    edges = np.diff(place, axis=0)
    arc = np.concatenate([[0.0], np.cumsum(rod.reference)])
    middle = 0.5 * (arc[1:] + arc[:-1])
    by_mass = rod.section.density * rod.section.area
    unit = np.eye(3)
    columns = [np.tile(axis, (place.shape[0], 1)) for axis in unit]
    columns += [-np.cross(place - place[0], axis) for axis in unit]
    weights = []
    for axis in unit:
        turning = by_mass * middle[:, None] * np.cross(edges, axis)
        weights.append(np.concatenate([np.zeros((1, 3)), np.cumsum(turning, axis=0)]))
    columns += [-weight for weight in weights]
    first, second = rod.directors()

    def bent(moment: FloatArray) -> FloatArray:
        along = np.concatenate([(moment.T * second).sum(axis=0), -(moment.T * first).sum(axis=0)])
        return np.asarray(along / rod.section.bending)

    weight = sum(pull * column for pull, column in zip(rod.gravity, weights, strict=True))
    lengths = np.tile(rod.voronoi, 2)
    left = (rod.curvatures() - rod.natural)[:2].ravel() / lengths - bent(np.asarray(weight))
    matrix = np.stack([bent(column) for column in columns], axis=1)
    by_length = np.sqrt(lengths) / _CURVATURE
    held = np.zeros((3, 9))
    held[:, 6:] = unit / _ACCELERATION
    solved, *_ = np.linalg.lstsq(
        np.concatenate([by_length[:, None] * matrix, held]),
        np.concatenate([by_length * left, np.zeros(3)]),
        rcond=None,
    )
    return np.asarray((lengths * (left - matrix @ solved)).reshape(2, -1))


# Of the training runs, and of their frames.
RUNS, FRAMES = 9, 400
ROUNDS = 8
# bending and viscosity as logarithms, drag, two natural curvatures, own
_START = np.array([math.log(0.03), math.log(0.1), 0.2, 0.0, 0.0, 0.5])
_LOWEST = np.array([math.log(1.0e-4), math.log(1.0e-3), 0.0, -15.0, -15.0, 0.0])
_HIGHEST = np.array([math.log(10.0), math.log(2.0), 20.0, 15.0, 15.0, 1.0])
# Forward differences must exceed what a whip of the cable makes of rounding.
_STEPS = np.array([0.03, 0.05, 0.05, 0.1, 0.1, 0.05])
_SCALE = 0.01  # [m] beyond which a residual counts linearly, not by its square
_LOST = 0.3  # [m] the residual of a run that diverges


def usual_gaps(runs: Sequence[FloatArray]) -> FloatArray:
    """Return the distances of neighbouring markers, median of all frames (markers - 1,) [m]."""
    gaps = [np.linalg.norm(np.diff(run, axis=1), axis=2) for run in runs]
    return np.asarray(np.median(np.concatenate(gaps), axis=0))


def fit(runs: Sequence[FloatArray], gaps: FloatArray) -> HeldCable:
    """Return the cable that explains some of the runs best.

    They are spread evenly over those in which no end is folded back: there two gripped markers
    were taken for one another.

    Args:
        runs: Training runs, each (frames, markers, 3) [m].
        gaps: Unstressed lengths between the markers [m].

    Raises:
        ExternalFileError: There is no run to fit on.
    """
    usable = [run for run in runs if not _folded(run)]
    if not usable:
        raise ExternalFileError("in every training run two gripped markers are exchanged")
    chosen = np.unique(np.linspace(0, len(usable) - 1, RUNS + 2)[1:-1].round().astype(int))
    some = [usable[i][:FRAMES] for i in chosen]

    def residuals(x: FloatArray) -> FloatArray:
        return np.concatenate([_residual(run, gaps, x) for run in some]) / _SCALE

    kept: dict[bytes, FloatArray] = {}

    def remembered(x: FloatArray) -> FloatArray:
        kept.clear()
        return kept.setdefault(x.tobytes(), residuals(x))

    def slopes(x: FloatArray) -> FloatArray:
        here = kept[x.tobytes()] if x.tobytes() in kept else residuals(x)
        columns = []
        for i, step in enumerate(_STEPS):
            moved = x.copy()
            moved[i] += step if x[i] + step <= _HIGHEST[i] else -step
            columns.append((residuals(moved) - here) / (moved[i] - x[i]))
        return np.stack(columns, axis=1)

    solved = least_squares(
        remembered,
        _START,
        jac=slopes,
        bounds=(_LOWEST, _HIGHEST),
        x_scale=10.0 * _STEPS,
        loss="soft_l1",
        max_nfev=ROUNDS,
    )
    return _cable(solved.x)


def _cable(x: FloatArray) -> HeldCable:
    return HeldCable(
        bending=math.exp(x[0]),
        viscosity=math.exp(x[1]),
        drag=float(x[2]),
        natural=(float(x[3]), float(x[4])),
        own=float(x[5]),
    )


def _residual(run: FloatArray, gaps: FloatArray, x: FloatArray) -> FloatArray:
    measured = run[2::4, 2:-2]
    try:
        return np.asarray((predict(run, gaps, _cable(x))[2::4, 2:-2] - measured).ravel())
    except DivergenceError:
        return np.full(measured.size, _LOST)


def _folded(run: FloatArray) -> bool:
    edges = np.diff(run, axis=1)
    turning = (edges[:, 1:] * edges[:, :-1]).sum(axis=2)
    return bool(turning[:, [0, -1]].min() < 0.0)


NAME = "deform"
# Every cable stays below this many times its published figure, half of them below the figure.
_MOST = 1.5


class HeldCableComparison:
    """Cables one after the other, then how many of them reach what was published."""

    def __init__(self) -> None:
        self._reached: list[bool] = []

    def compare(self, runs: CapturedCable) -> Iterator[ExternalRow]:
        """Fit a cable on its training runs; yield its error on the held-out ones.

        Raises:
            ExternalFileError: There is no run to fit on.
            SolverError: A run diverges with the fitted cable.
        """
        gaps = usual_gaps(runs.train)
        cable = fit(runs.train, gaps)
        losses = []
        begun = time.process_time()
        for number, run in enumerate(runs.held_out, 1):
            try:
                losses.append(loss(predict(run, gaps, cable), run))
            except DivergenceError as error:
                raise DivergenceError(f"{runs.name}, held-out run {number}: {error}") from error
        spent = time.process_time() - begun
        simulated = sum(run.shape[0] - 2 for run in runs.held_out) * FRAME_TIME
        mean = float(np.mean(losses))
        if runs.published is not None:
            self._reached.append(mean <= runs.published)
        yield ExternalRow(
            experiment=NAME,
            variant=f"{runs.name}, {len(losses)} runs held out; {_described(cable)}",
            quantity="coordinate_error",
            computed=mean,
            bar=None if runs.published is None else _MOST * runs.published,
            published={} if runs.published is None else {"DEFORM": runs.published},
        )
        yield ExternalRow(
            experiment=NAME,
            variant=runs.name,
            quantity="processor_time_per_time",
            computed=spent / simulated,
        )

    def reached(self) -> Iterator[ExternalRow]:
        """Yield the share of the cables whose error is at most the published one."""
        if self._reached:
            yield ExternalRow(
                experiment=NAME,
                variant=f"{len(self._reached)} cables with a published figure",
                quantity="share_at_most_published",
                computed=float(np.mean(self._reached)),
                bar=0.5,
                at_least=True,
            )


def _described(cable: HeldCable) -> str:
    first, second = cable.natural
    return (
        f"EI by mass {cable.bending:.3g}, viscosity {cable.viscosity:.3g}, drag {cable.drag:.2g}, "
        f"natural {first:.2g} {second:.2g}, own {cable.own:.2g}"
    )
