"""Tables of evidence in `winding study`: markers within a run, the K-NN under simulated noise."""

from __future__ import annotations

from collections.abc import Sequence

from correction_node.live.neighbours import Noise
from correction_node.models.dataset import LengthCell
from winding_core.units import MILLIMETRE
from winding_reports.documents.data_table import Column, DataTable, Value
from winding_verification.correction.repeatability import LABEL, NoiseAccuracy, accuracy_by_noise
from winding_verification.correction.within_run_score import WithinRunScore, score_within_run

# Of a length between repetitions, from a good camera to a poor one.
NOISES = (0.0025, 0.005, 0.01, 0.02, 0.04)


def correction_tables(cells: Sequence[LengthCell]) -> tuple[DataTable, DataTable]:
    """Return the two tables of a study that rest on evidence.

    Args:
        cells: Measured cells with predictions whose increments are about even.

    Returns:
        How P3 and P4 of a run follow from its measured P1 and P2; K-NN accuracy against noise.
    """
    return within_table(score_within_run(cells)), noise_table(accuracy_by_noise(NOISES))


def noise_table(found: Sequence[NoiseAccuracy]) -> DataTable:
    """Return the K-NN's accuracy by simulated noise; every kind has the same noises."""
    kinds = list(dict.fromkeys(entry.kind for entry in found))
    shares = {(entry.noise, entry.kind): 100.0 * entry.accuracy for entry in found}
    names = {Noise.RUN: "one error for a run", Noise.MARKER: "one error for each marker"}
    return DataTable(
        name="neighbours_simulated",
        title="K-nearest neighbours: conditions named rightly, simulated, in %",
        columns=(
            Column(name="noise of a length, %"),
            *(Column(name=names[kind], digits=1) for kind in kinds),
        ),
        rows=tuple(
            (100.0 * noise, *(shares[noise, kind] for kind in kinds))
            for noise in dict.fromkeys(entry.noise for entry in found)
        ),
        note=f"{LABEL[0].upper()}{LABEL[1:]}. Repeating a run makes all of its lengths longer or "
        "shorter together; errors of each marker are shown beside it.",
    )


def within_table(score: WithinRunScore) -> DataTable:
    """Return how the markers after the measured ones are predicted, beside plain rivals."""
    given = " and ".join(f"P{n}" for n in range(1, score.measured + 1))
    asked = " and ".join(f"P{n}" for n in score.by_marker_pct)
    length = f"{score.build_up_length / MILLIMETRE:.0f} mm"
    rows: list[tuple[Value, ...]] = [
        (
            "build-up law, its case left out",
            score.held_out_pct,
            score.worst.error_pct,
            100.0 * score.coverage,
            score.half_width_pct,
        ),
        ("build-up law, in-sample", score.in_sample_pct, None, None, None),
    ]
    rows += [(name, error, None, None, None) for name, error in score.rivals_pct.items()]
    return DataTable(
        name="within_run",
        title=f"Within a run: {asked} from the measured {given}, in % of the length",
        columns=(
            Column(name="way"),
            Column(name="mean error"),
            Column(name="worst cell"),
            Column(name="cells inside the bounds", digits=0),
            Column(name="mean half-width of the bounds"),
        ),
        rows=tuple(rows),
        note=f"One length of {length} is learned over cases; worst is P{score.worst.marker} of "
        f"case {score.worst.case}. Rivals learn nothing. {_better(score)}",
    )


def _better(score: WithinRunScore) -> str:
    rival = min(score.rivals_pct, key=lambda name: score.rivals_pct[name])
    if score.rivals_pct[rival] <= score.held_out_pct:
        return f"Here the plain rival '{rival}' is better than the law."
    return "The law is better than both."
