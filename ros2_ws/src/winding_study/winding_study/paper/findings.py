"""From wound cases to everything that a study found: comparison, models of h, tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from correction_node.models.dataset import DataSet, LengthCell, join_experiment, load_data_set
from correction_node.training.comparison import compare_models
from correction_node.training.training import TrainingConfig
from winding_core.machine.drive import PAPER_DURATION
from winding_reports.documents.data_table import DataTable
from winding_study.paper.case_result import CaseResult
from winding_study.paper.comparison import Comparison, compare, compare_paper
from winding_study.paper.study import StudyConfig, predicted_lengths
from winding_study.paper.study_record import StudyRecord

# Returns the tables of evidence, `within` and `noise` of a StudyRecord, from measured cells.
Evidence = Callable[[Sequence[LengthCell]], tuple[DataTable, DataTable]]


def beside_experiment(
    config: StudyConfig | None, cases: tuple[int, ...], results: tuple[CaseResult, ...]
) -> Comparison:
    """Return the base of a study beside the experiment.

    Args:
        config: What was wound; None takes the paper's simulation as the base.
        cases: Rows of Table 1.
        results: The wound cases.

    Raises:
        ValueError: A measured marker was not wound, or of short runs none was.
    """
    if config is None:
        return compare_paper([key for key in compare_paper().keys if key[0] in cases])
    return compare(results, partial=config.duration < PAPER_DURATION)


def study_record(
    config: StudyConfig | None,
    cases: tuple[int, ...],
    results: tuple[CaseResult, ...],
    comparison: Comparison,
    *,
    seeds: tuple[int, ...],
    steps: int | None,
    progress: Callable[[str], None],
    evidence: Evidence | None = None,
) -> StudyRecord:
    """Return what a study found; models of h are learned when every measured marker is there.

    Args:
        config: What was wound; None takes the paper's simulation as the base.
        cases: Rows of Table 1.
        results: The wound cases.
        comparison: Of the base, as from `beside_experiment`.
        seeds: Of the models that start at random; none trains nothing.
        steps: Training steps of a network; None takes the usual number.
        progress: Called with one short sentence after each model.
        evidence: Makes the tables of evidence; None where it is not installed.
    """
    if comparison.keys != compare_paper().keys:
        return StudyRecord(config=config, cases=cases, comparison=comparison, results=results)
    data = even = load_data_set("paper")
    if config is None:
        # The law within a run needs increments that are about even, and the paper's simulation is
        # off by up to 37 % at the first marker of two cases: this project's rod stands in.
        even = load_data_set("rod")
    else:
        lengths = {(case, marker): s for case, marker, s in predicted_lengths(results)}
        name = f"own {config.element}"
        data = even = DataSet(name=name, cells=join_experiment(lengths, source=name))
    models = {}
    if seeds:
        steps = TrainingConfig().steps if steps is None else steps
        models = compare_models(data, seeds=seeds, steps=steps, progress=progress)
    within, noise = (None, None) if evidence is None else evidence(even.cells)
    return StudyRecord(
        config=config,
        cases=cases,
        comparison=comparison,
        results=results,
        cells=data.cells if models else (),
        models=models,
        within=within,
        noise=noise,
    )
