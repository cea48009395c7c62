"""A running correction: the weight first, then what the run itself has measured."""

import numpy as np
import pytest

from correction_node.live.corrector import Corrector
from correction_node.live.measured_run import SETTLED_FRAMES
from correction_node.live.run_corrector import ARRIVAL, RunCorrector
from correction_node.live.within_run import published_within_run
from correction_node.models.dataset import load_data_set
from correction_node.models.weights import load_factor, weights_directory
from winding_core.cable.cases import Case, paper_case
from winding_core.markers import MarkerFlag, Markers, wound_markers

CORRECTOR = Corrector(load_factor(weights_directory("rod")))
LAW = published_within_run()
# Its increments grow along the cable, and all four markers were measured.
NUMBER = 9
CASE = paper_case(NUMBER)
# Time of the last frame, and of a prediction that may use it.
LATE, LATER = 10.0, 10.0 + ARRIVAL
S_FEM = [cell.s_fem for cell in load_data_set("rod").cells if cell.case == NUMBER]
S_EXP = [cell.s_exp for cell in load_data_set("rod").cells if cell.case == NUMBER]


def records(lengths: list[float], case: Case = CASE, **columns: object) -> Markers:
    """Return wound marker records with given lengths, P1 first."""
    made = wound_markers(
        ids=np.arange(1, len(lengths) + 1),
        theta=np.zeros(len(lengths)),
        z=np.zeros(len(lengths)),
        radius=case.centreline_radius,
        cylinder_angle=0.0,
    )
    made["s"] = lengths
    for name, values in columns.items():
        made[name] = values
    return made


def frames(
    run: RunCorrector, lengths: list[float], count: int = SETTLED_FRAMES, t: float = LATE
) -> None:
    """Let the tracker see P1, P2, ... where they lie, for some frames."""
    for _ in range(count):
        run.measured.take(t, records(lengths))


@pytest.fixture
def run() -> RunCorrector:
    return RunCorrector(CORRECTOR, LAW, CASE)


@pytest.fixture
def untouched() -> Markers:
    """Return the correction of a run that has measured nothing."""
    return RunCorrector(CORRECTOR, LAW, CASE).correct(LATER, records(S_FEM))


def test_before_anything_is_measured_the_weight_corrects(run: RunCorrector) -> None:
    fem = records(S_FEM)
    np.testing.assert_array_equal(run.correct(LATER, fem), CORRECTOR.correct(fem, CASE))
    assert run.basis == ()


def test_markers_ahead_follow_the_law_of_the_measured_ones(run: RunCorrector) -> None:
    frames(run, S_EXP[:2])
    corrected = run.correct(LATER, records(S_FEM))
    for marker in (3, 4):
        expected = LAW.length_ahead(
            marker, spacing=CASE.marker_spacing, predicted=S_FEM, measured=S_EXP[:2]
        )
        assert corrected["s"][marker - 1] == pytest.approx(expected.s, rel=1e-12)
        half = 0.5 * (corrected["s_high"] - corrected["s_low"])[marker - 1]
        assert half == pytest.approx(LAW.half_width(expected), rel=1e-9)
    assert run.basis == (1, 2)
    np.testing.assert_allclose(corrected["h"] * corrected["s_fem"], corrected["s"], rtol=1e-12)


def test_a_first_measured_marker_carries_the_weights_increments(run: RunCorrector) -> None:
    plain = CORRECTOR.correct(records(S_FEM), CASE)["s"]
    frames(run, S_EXP[:1])
    corrected = run.correct(LATER, records(S_FEM))
    np.testing.assert_allclose(corrected["s"][1:], S_EXP[0] + plain[1:] - plain[0], rtol=1e-12)


def test_one_measured_marker_helps_cases_that_the_weight_never_saw() -> None:
    cells = load_data_set("rod").cells
    left_out = load_factor(weights_directory("rod")).card["h_left_out"]
    bound = CORRECTOR.factor(CASE).relative_bound
    alone, helped, covered = [], [], []
    for number in range(1, 13):
        mine = [cell for cell in cells if cell.case == number]
        plain = [h * cell.s_fem for h, cell in zip(left_out[str(number)], mine, strict=True)]
        for s, cell in zip(plain[1:], mine[1:], strict=True):
            carried = mine[0].s_exp + s - plain[0]
            alone.append(abs(cell.s_exp - s) / s)
            helped.append(abs(cell.s_exp - carried) / carried)
            covered.append(abs(cell.s_exp - carried) <= bound * (s - plain[0]))
    assert np.mean(helped) < np.mean(alone)
    assert np.mean(covered) >= 0.9


def test_intervals_narrow_as_more_is_measured(run: RunCorrector) -> None:
    widths = []
    for known in range(4):
        run.forget()
        frames(run, S_EXP[:known])
        corrected = run.correct(LATER, records(S_FEM))
        widths.append((corrected["s_high"] - corrected["s_low"])[3])
        assert corrected["s_low"][3] <= S_EXP[3] <= corrected["s_high"][3]
    assert widths == sorted(widths, reverse=True)
    assert widths[3] < 0.5 * widths[0]


def test_a_measurement_never_corrects_its_own_marker(run: RunCorrector, untouched: Markers) -> None:
    frames(run, S_EXP[:1])
    assert run.correct(LATER, records(S_FEM))["s"][0] == untouched["s"][0]


def test_a_marker_counts_once_enough_frames_saw_it(run: RunCorrector, untouched: Markers) -> None:
    frames(run, S_EXP[:1], SETTLED_FRAMES - 1)
    np.testing.assert_array_equal(run.correct(LATER, records(S_FEM)), untouched)
    frames(run, S_EXP[:1], 1)
    assert (run.correct(LATER, records(S_FEM))["s"] != untouched["s"]).any()


def test_one_garbage_frame_moves_nothing(run: RunCorrector) -> None:
    other = RunCorrector(CORRECTOR, LAW, CASE)
    frames(other, S_EXP[:2], SETTLED_FRAMES + 1)
    for frame in range(SETTLED_FRAMES + 1):
        garbage = frame == 3
        run.measured.take(LATE, records([S_EXP[0], S_EXP[1] * (1.3 if garbage else 1.0)]))
    np.testing.assert_array_equal(
        run.correct(LATER, records(S_FEM)), other.correct(LATER, records(S_FEM))
    )


def test_a_known_length_is_not_moved_by_later_frames(run: RunCorrector) -> None:
    frames(run, S_EXP[:2])
    before = run.correct(LATER, records(S_FEM))
    frames(run, [S_EXP[0], 1.01 * S_EXP[1]], 100)
    np.testing.assert_array_equal(run.correct(LATER, records(S_FEM)), before)


def test_corrections_do_not_depend_on_what_arrives_first(run: RunCorrector) -> None:
    # Frames every 5 ms, predictions every 20 ms; the tracker up to ARRIVAL late or early.
    fem, period = records(S_FEM), 0.005
    steps = range(4, 400, 4)
    answers = []
    for shift in (-int(ARRIVAL / period) + 1, 0, 150):
        run.forget()
        taken, lengths = 0, []
        for step in steps:
            while taken <= step + shift:
                run.measured.take(period * taken, records(S_EXP[: 1 + taken // 100]))
                taken += 1
            lengths.append(run.correct(period * step, fem)["s"])
        answers.append(np.array(lengths))
    np.testing.assert_array_equal(answers[0], answers[1])
    np.testing.assert_array_equal(answers[2], answers[1])
    # It was not the weight alone that answered.
    assert len(np.unique(answers[0][:, 3])) == 4


def test_time_that_goes_back_begins_a_new_run(run: RunCorrector) -> None:
    frames(run, S_EXP[:2])
    frames(run, S_EXP[:1], 1, t=1.0)
    assert run.measured.settled == set()
    assert run.measured.seen == {1}


def test_a_marker_that_stays_far_off_is_rejected_and_reported(run: RunCorrector) -> None:
    frames(run, S_EXP[:2])
    before = run.correct(LATER, records(S_FEM))
    frames(run, [*S_EXP[:2], S_EXP[1] + 1.5 * CASE.marker_spacing])
    np.testing.assert_array_equal(run.correct(LATER, records(S_FEM)), before)
    assert run.basis == (1, 2)
    assert any("marker 3 measured at" in refusal for refusal in run.refusals)


@pytest.mark.parametrize(
    ("lengths", "sentence", "basis"),
    [
        ([np.nan], "no usable length", ()),
        ([np.inf], "no usable length", ()),
        ([-0.2], "no usable length", ()),
        ([0.15], "shorter than physics allows", ()),
        ([0.211, 0.428, 0.43], "marker 3 is shorter than physics allows", (1, 2)),
        # Of these P1 is longer than anybody expects, so it is not used either.
        ([0.60, 0.45], "marker 2 lies before marker 1", ()),
    ],
)
def test_what_no_cable_can_be_is_counted_and_not_used(
    run: RunCorrector, lengths: list[float], sentence: str, basis: tuple[int, ...]
) -> None:
    frames(run, lengths, 2 * SETTLED_FRAMES)
    assert run.measured.refused == 2 * SETTLED_FRAMES
    assert sentence in run.measured.last_refusal
    run.correct(LATER, records(S_FEM))
    assert run.basis == basis


@pytest.mark.parametrize("flag", MarkerFlag)
def test_a_flagged_marker_is_no_measurement_and_no_fault(
    run: RunCorrector, untouched: Markers, flag: MarkerFlag
) -> None:
    for _ in range(2 * SETTLED_FRAMES):
        run.measured.take(LATE, records(S_EXP[:2], flags=int(flag)))
    np.testing.assert_array_equal(run.correct(LATER, records(S_FEM)), untouched)
    assert run.measured.refused == 0


def test_a_slipped_marker_is_forgotten(run: RunCorrector) -> None:
    frames(run, S_EXP[:2])
    assert run.measured.settled == {1, 2}
    run.measured.take(LATE, records(S_EXP[:2], flags=[0, int(MarkerFlag.SLIPPED)]))
    assert run.measured.settled == {1}


def test_a_frame_with_nothing_wound_begins_a_new_run(run: RunCorrector, untouched: Markers) -> None:
    frames(run, S_EXP[:2])
    run.measured.take(LATE, records(S_EXP[:2], flags=int(MarkerFlag.NOT_WOUND)))
    np.testing.assert_array_equal(run.correct(LATER, records(S_FEM)), untouched)


def test_a_hidden_marker_is_bridged(run: RunCorrector) -> None:
    for _ in range(SETTLED_FRAMES):
        run.measured.take(LATE, records(S_EXP[:3], flags=[0, int(MarkerFlag.OCCLUDED), 0]))
    corrected = run.correct(LATER, records(S_FEM))
    assert run.basis == (1, 3)
    assert 100.0 * abs(S_EXP[3] / corrected["s"][3] - 1.0) < 1.0


def test_an_unusable_prediction_is_refused_and_the_others_are_corrected(run: RunCorrector) -> None:
    frames(run, S_EXP[:1])
    assert run.correct(LATER, records([S_FEM[0], np.nan, S_FEM[2]]))["id"].tolist() == [1, 3]
    assert any("marker 2" in refusal for refusal in run.refusals)


@pytest.mark.parametrize("strange", [5, 2**32 - 1])
def test_a_marker_that_the_cable_does_not_have_is_refused(run: RunCorrector, strange: int) -> None:
    fem = records([*S_FEM[:2], S_FEM[3]], id=[1, 2, strange])
    for _ in range(SETTLED_FRAMES):
        run.measured.take(LATE, fem)
    assert run.correct(LATER, fem)["id"].tolist() == [1, 2]
    assert "marker that the cable does not have" in run.refusals[0]
    assert run.measured.refused == SETTLED_FRAMES
    assert run.basis == (1, 2)


def test_every_published_run_is_believed() -> None:
    for number in range(1, 13):
        cells = [cell for cell in load_data_set("rod").cells if cell.case == number]
        run = RunCorrector(CORRECTOR, LAW, paper_case(number))
        frames(run, [cell.s_exp for cell in cells])
        run.correct(LATER, records([cell.s_fem for cell in cells]))
        assert run.basis == tuple(range(1, len(cells) + 1))
        assert run.refusals == ()


def test_outside_the_trained_conditions_bounds_within_the_run_are_doubled() -> None:
    known = paper_case(4)
    other = Case(
        cylinder_diameter=known.cylinder_diameter,
        cable_diameter=known.cable_diameter,
        weight=20.0 * known.weight,
        marker_spacing=known.marker_spacing,
    )
    widths = {}
    for case in (known, other):
        run = RunCorrector(CORRECTOR, LAW, case)
        fem = [0.112, 0.224, 0.336, 0.448]
        # Measured where predicted: the law carries on, whatever the weight gives.
        frames(run, fem[:2])
        corrected = run.correct(LATER, records(fem))
        widths[case.weight] = (corrected["s_high"] - corrected["s_low"])[3]
        assert run.basis == (1, 2)
        assert (run.outside is not None) == (case is other)
    assert widths[other.weight] == pytest.approx(2.0 * widths[known.weight], rel=1e-9)


def test_a_spacing_outside_the_training_data_is_reported() -> None:
    case = Case(cylinder_diameter=0.03, cable_diameter=0.004, weight=2.0, marker_spacing=0.02)
    assert "marker_spacing 0.02 m" in RunCorrector(CORRECTOR, LAW, case).outside
