"""A number stands for the same problem for ever; a problem counts, repairs and keeps its budget in any library's loop."""

import json
from collections.abc import Callable
from copy import copy, deepcopy
from itertools import product
from pathlib import Path
from pickle import PicklingError
from typing import Any

import numpy as np
import pytest
from scipy.optimize import differential_evolution

import posefit
from posefit.fitting.box import draw_population
from posefit.fitting.problem import BudgetSpentError, Problem
from posefit.motion.instances import HELD_OUT, TRAINING
from posefit.suites.boxes import HELD_OUT_PEOPLE, TRAINING_PEOPLE, learned_without
from posefit.suites.functions import FUNCTIONS, SUITE
from posefit.suites.instances import suite_instance
from posefit.suites.running import run_on
from posefit_bridges.problems import close_log, ioh_problem
from tests.cases import each
from tests.suites.numbers import FILE, addresses, areas_of, fixed_proposals, mask_of

ROWS = {tuple(row[:3]): row[3:] for row in json.loads(FILE.read_text("utf-8"))}


def problem(
    function: int = 1, instance: int = 17, dimension: int = 9, **more: object
) -> Problem:
    return posefit.suite(SUITE, function, instance, dimension, **more)  # type: ignore[arg-type]


def infeasible(posed: Problem) -> np.ndarray:
    """Return proposals (20, d) of the box that are no poses."""
    drawn = np.random.default_rng(3).uniform(-1.0, 1.0, (500, posed.dimension))
    return drawn[~posed.space.feasible(drawn)][:20]


def test_the_numbers_have_not_changed_since_the_suite_was_made() -> None:
    assert set(ROWS) == set(addresses())
    for address, (mask, areas) in ROWS.items():
        assert mask_of(*address) == mask, address
        assert areas_of(*address) == areas, address


@each("address", [(1, 17, 9), (3, 10_000, 40), (5, 17, 16), (7, 19_999, 66)])
def test_a_cost_is_a_ratio_of_whole_numbers_of_pixels(
    address: tuple[int, int, int],
) -> None:
    missed, spilled, both = np.moveaxis(np.array(ROWS[address][1], dtype=float), 2, 0)
    shares = 0.5 * missed / (missed + both) + 0.5 * spilled / (spilled + both)
    costs = problem(*address)(fixed_proposals(address[2]))
    assert costs == pytest.approx(100.0 * shares.mean(axis=0), abs=1e-12)


def test_the_true_pose_is_in_the_box_and_is_the_known_optimum() -> None:
    for function, number in product(FUNCTIONS, (1, 2, 10_001, 10_002)):
        for dimension in function.dimensions:
            posed = problem(function.number, number, dimension)
            assert posed.space.feasible(posed.made.truth[None])[0]
            assert posed.noise_free(posed.made.truth) == posed.truth_cost
            assert (posed.optimum == 0.0 == posed.truth_cost) == function.exact
            assert posed.truth_cost < 40.0


def test_the_truth_cannot_be_written_to() -> None:
    with pytest.raises(ValueError, match="read-only"):
        problem().made.truth[0] = 0.0


def test_a_box_is_learned_from_other_people() -> None:
    subjects = {
        number: suite_instance(1, number, 9).subject
        for number in (*range(40), *HELD_OUT[:40])
    }
    assert {subjects[number] for number in subjects if number in TRAINING} == set(
        TRAINING_PEOPLE
    )
    assert {subjects[number] for number in subjects if number in HELD_OUT} == set(
        HELD_OUT_PEOPLE
    )
    means = {
        subject: learned_without(subject).mean.tobytes()
        for subject in (*TRAINING_PEOPLE, *HELD_OUT_PEOPLE)
    }
    assert len({means[subject] for subject in TRAINING_PEOPLE}) == len(TRAINING_PEOPLE)
    assert len({means[subject] for subject in HELD_OUT_PEOPLE}) == 1


def test_a_noisy_call_has_noise_and_the_record_has_none() -> None:
    drawn = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 9))
    posed = problem(4)
    other = problem(4)
    quiet = problem(4).noise_free(drawn)
    costs = posed(drawn)
    assert np.array_equal(
        costs,
        np.concatenate([other(drawn[:7]), [other(proposal) for proposal in drawn[7:]]]),
    )
    posed.reset()
    assert np.array_equal(posed(drawn), costs)
    assert (costs != quiet).mean() > 0.9
    assert set(posed.trace[1]) == set(np.minimum.accumulate(quiet))
    again = posed(np.tile(posed.made.truth, (500, 1)))
    assert 1.0 < again.std() < 10.0
    assert posed.best_observed_fvalue1 == posed.optimum == 0.0
    assert posed.final_target_hit
    assert np.isinf(problem(4, infeasible="reject")(infeasible(posed))).all()


def test_a_sequence_is_a_motion_along_a_few_components() -> None:
    posed = problem(5, 10_000, 40)
    box = posed.made.box
    frames = posed.made.frames
    motion = np.array([frame.decode(posed.made.truth[None])[0][0] for frame in frames])
    assert len(np.unique(motion[:, 3:], axis=0)) == len(frames) == 8
    assert np.ptp(motion[:, :3], axis=0).tolist() == [0.0] * 3
    latents = np.random.default_rng(0).uniform(box.low, box.high, (5, 37))
    for latent in latents:
        angles = np.concatenate(
            [frame.inverse_transform(latent[None]) for frame in box.frames]
        )
        assert box.transform(angles)[0] == pytest.approx(latent, abs=0.02)
    drawn = np.random.default_rng(1).uniform(-1.0, 1.0, (6, 40))
    assert posed(drawn) == pytest.approx(
        np.mean([frame(drawn) for frame in frames], axis=0)
    )


def test_mixed_components_have_two_to_sixteen_values_and_each_fifth_has_any() -> None:
    box = problem(6, 10_000, 24).made.box
    latents = np.random.default_rng(0).uniform(box.low, box.high, (2000, 21))
    stepped = box.transform(box.inverse_transform(latents)) / box.high
    values = [len(np.unique(np.round(16.0 * column))) for column in stepped.T]
    assert values[:4] == values[15:19] == [2, 4, 8, 16]
    assert min(values[4::5]) == 33
    assert np.abs(stepped[:, 0]) == pytest.approx(0.5, abs=0.01)


def test_a_next_frame_starts_near_a_prediction_and_nearer_than_anywhere() -> None:
    near = []
    anywhere = []
    for number in range(10_000, 10_008):
        posed = problem(2, number, 16)
        rng = np.random.default_rng(0)
        near.append(np.median(posed(draw_population(posed.space, rng, 60))))
        anywhere.append(np.median(posed(rng.uniform(-1.0, 1.0, (60, 16)))))
        assert np.array_equal(posed.initial_solution, posed.start.mean)
    assert np.mean(near) < 0.6 * np.mean(anywhere)


def test_a_proposal_has_a_float_and_several_have_an_array_with_the_same_bits() -> None:
    posed = problem()
    drawn = np.random.default_rng(0).uniform(-1.0, 1.0, (7, 9))
    alone = [posed(proposal) for proposal in drawn]
    assert all(type(cost) is float for cost in alone)
    assert np.array_equal(posed(drawn), alone)
    assert posed(drawn[0].tolist()) == alone[0]
    assert posed.evaluations == 15


def test_an_infeasible_proposal_costs_as_much_as_its_repair() -> None:
    for posed in (problem(1, 17, 9), problem(1, 10_017, 24), problem(6, 3, 40)):
        bad = infeasible(posed)
        mended = posed.repaired(bad)
        assert len(bad) == 20
        assert posed.space.feasible(mended).all()
        assert np.array_equal(posed(bad), posed(mended))
        assert np.array_equal(posed.repaired(mended), mended)
        # straight towards the middle
        assert np.ptp(mended[:, 3:] / bad[:, 3:], axis=1).max() < 1e-9
        assert posed(np.full(posed.dimension, 3.0)) == posed(np.ones(posed.dimension))


def test_infeasible_proposals_may_be_rejected_or_penalised_instead() -> None:
    bad = infeasible(problem())
    repaired = problem()(bad)
    rejecting = problem(infeasible="reject")
    penalising = problem(infeasible="penalise")
    assert np.isinf(rejecting(bad)).all()
    assert (rejecting.evaluations, [len(part) for part in rejecting.trace]) == (
        20,
        [0, 0],
    )
    assert rejecting(np.zeros(9)) == problem()(np.zeros(9))
    assert rejecting.trace[0].tolist() == [21.0]
    far = np.linalg.norm(bad - penalising.repaired(bad), axis=1)
    assert penalising(bad) == pytest.approx(repaired + 100.0 * far, abs=1e-9)
    assert problem(infeasible="penalise")(np.zeros(9)) == problem()(np.zeros(9))


def test_a_budget_of_evaluations_holds() -> None:
    posed = problem(budget=5)
    for fits, left, beyond in ((3, 2, 3), (2, 0, 1)):
        posed(np.zeros((fits, 9)))
        with pytest.raises(
            BudgetSpentError, match=f"{left} of 5 evaluations are left, got {beyond}"
        ):
            posed(np.zeros((beyond, 9)) if beyond > 1 else np.zeros(9))
        assert (posed.evaluations, posed.remaining_evaluations) == (5 - left, left)


def test_targets_fall_to_a_quarter_above_the_cost_of_the_true_pose() -> None:
    for posed in (problem(1, 10_000, 9), problem(8, 10_000, 9)):
        assert posed.targets - posed.truth_cost == pytest.approx(
            [2.0 ** (5 - k / 4) for k in range(29)]
        )
        assert not posed.final_target_hit
        posed(posed.made.truth)
        assert posed.final_target_hit


def test_a_rotated_box_has_the_size_of_the_plain_one_and_no_coordinate_is_a_joint_angle() -> (
    None
):
    """A rotation keeps lengths; rounded to four digits it does so to about one in a thousand."""
    plain, rotated = (problem(number, 10_000, 66).made.box for number in (7, 9))
    latents = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 63))
    away = (rotated.inverse_transform(latents) - plain.mean) / plain.reach
    assert np.linalg.norm(away, axis=1) == pytest.approx(
        np.linalg.norm(latents, axis=1), rel=2e-3
    )
    assert np.abs(rotated.components / plain.reach).max() < 0.8
    assert rotated.transform(rotated.inverse_transform(latents)) == pytest.approx(
        latents, abs=1e-2
    )
    other = problem(9, 10_001, 66).made.box
    assert not np.array_equal(rotated.components, other.components)


def test_a_suite_iterates_over_its_problems_and_lists_its_functions() -> None:
    suite = posefit.Suite(
        functions=[7, 1], dimensions=[9, 24, 66], instances=[3, 10_003]
    )
    order = ((1, 9), (7, 24), (1, 24), (7, 66))
    expected = [
        f"f{function:03d}_i{n:05d}_d{d:02d}"
        for function, d in order
        for n in (3, 10_003)
    ]
    assert [posed.id.partition("_")[2] for posed in suite] == expected
    assert [posed.index for posed in suite] == list(range(len(suite)))
    assert [function.name for function in suite.functions] == [
        "single image",
        "high-dimensional",
    ]
    assert len(posefit.Suite()) == 15 * sum(
        len(function.dimensions) for function in FUNCTIONS
    )
    assert suite[0] is not suite[0]  # nothing evaluated yet, each time


@each("numbers", [tuple, iter, np.array])
def test_a_suite_takes_any_kind_of_numbers(numbers: Callable[[Any], Any]) -> None:
    suite = posefit.Suite(
        functions=numbers([1, 7]),
        dimensions=numbers([9, 20]),
        instances=numbers([3, 10_003]),
    )
    # function 7 has no problem in 9 dimensions
    expected = [
        f"f{function:03d}_i{instance:05d}_d{d:02d}"
        for function, d in ((1, 9), (1, 20), (7, 20))
        for instance in (3, 10_003)
    ]
    assert [posed.id.partition("_")[2] for posed in suite] == expected


def test_a_problem_is_not_sent_to_another_process_where_its_evaluations_would_not_be_counted() -> (
    None
):
    posed = problem()
    with pytest.raises(
        PicklingError,
        match="cannot be sent to another: make it there",
    ):
        differential_evolution(
            posed, [(-1.0, 1.0)] * 9, workers=2, updating="deferred", maxiter=1
        )


@each("copied", [copy, deepcopy])
def test_a_copy_of_a_problem_counts_for_itself(
    copied: Callable[[Problem], Problem],
) -> None:
    posed = problem()
    posed(np.zeros(9))
    twin = copied(posed)
    twin(np.full(9, 0.1))
    assert not posed.looked
    assert twin.look()
    assert (twin.looked, posed.looked) == (True, False)
    assert (posed.evaluations, twin.evaluations) == (1, 2)
    assert len(posed.trace[0]) == 1


@each(
    ("make", "message"),
    [
        (
            lambda: posefit.suite("posefit-2025", 1, 0, 9),
            "suite must be one of posefit-2026.3, got 'posefit-2025'",
        ),
        (
            lambda: problem(10),
            "function must be one of 1, 2, 3, 4, 5, 6, 7, 8, 9, got 10",
        ),
        (
            lambda: problem(np.array([1, 2])),
            r"function must be a whole number of at least 1, got array\(\[1, 2\]\)",
        ),  # type: ignore[arg-type]
        (lambda: problem(1, 20_000), "instance must lie in 0 to 19999, got 20000"),
        (
            lambda: problem(7, 0, 9),
            "dimension of function 7 must be one of 20, 24, 40, 66, got 9",
        ),
        (
            lambda: problem(infeasible="ignore"),
            "infeasible must be one of repair, reject, penalise, got 'ignore'",
        ),
        (lambda: problem(budget=0), "budget must be at least 1, got 0"),
        (
            lambda: posefit.Suite(functions=[1], dimensions=[66]),
            r"at least one problem, got none in \[66\] dimensions",
        ),
        (
            lambda: posefit.Suite(dimensions=[11]),
            "dimension must be one of 9, 10, 16, 20, 24, 40, 66, got 11",
        ),
        (
            lambda: posefit.Suite()[0:2],
            r"index must be the number of one problem, got slice\(0, 2, None\)",
        ),
        (
            lambda: posefit.Suite(functions=9),
            "functions must be a list of numbers, got 9",
        ),  # type: ignore[arg-type]
        (
            lambda: posefit.Suite(dimensions="9"),
            "dimensions must be a list of numbers, got '9'",
        ),  # type: ignore[arg-type]
        (
            lambda: posefit.Suite(functions=[]),
            "functions must contain at least one number, got none",
        ),
        (
            lambda: posefit.Suite(instances=[]),
            "instances must contain at least one number, got none",
        ),
        (
            lambda: posefit.Suite(functions=[1, 2, 1], instances=[3]),
            "the problems of a suite must differ, got f1 instance 3 in 9D twice",
        ),
        (
            lambda: posefit.Suite(functions=[1], dimensions=[9, 9]),
            "must differ, got f1 instance 10000 in 9D twice",
        ),
        (
            lambda: posefit.Suite(functions=[1], instances=[4, 3, np.int64(3)]),
            "must differ, got f1 instance 3 in 9D twice",
        ),
    ],
)
def test_an_object_that_is_not_a_problem_is_named(
    make: Callable[[], object], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        make()


@each(
    ("proposals", "message"),
    [
        ([0.0] * 8, r"proposals must have shape \(9,\) or \(n, 9\), got \(8,\)"),
        (np.zeros((2, 2, 9)), r"got \(2, 2, 9\)"),
        ([np.nan] * 9, "proposals must be finite, got nan or infinity"),
        ("abc", "proposals must be numbers, got 'abc'"),
    ],
)
def test_wrong_proposals_are_refused_and_not_counted(
    proposals: object, message: str
) -> None:
    posed = problem()
    with pytest.raises(ValueError, match=message):
        posed(proposals)
    assert posed.evaluations == 0


ADDRESSES = [(1, 10_003, 9), (8, 12_345, 16), (7, 2, 66)]
BUDGET = 400


def swarm(space: posefit.Space) -> posefit.Optimiser:
    return posefit.optimiser("pso")(space, np.random.default_rng(1), population_size=20)


def test_iohexperimenter_has_the_trace_of_a_plain_loop_in_each_run() -> None:
    pytest.importorskip("ioh", reason="it is in the extra test")
    for address in ADDRESSES:
        plain, posed = (posefit.suite(SUITE, *address) for _ in range(2))
        plain.budget = BUDGET
        posefit.minimise(plain, swarm(plain.space))
        assert plain.best_cost == plain.best_observed_fvalue1 == plain.trace[1][-1]
        wrapped = ioh_problem(posed)
        meta = wrapped.meta_data
        assert (meta.problem_id, meta.instance, meta.n_variables) == (
            26_300 + address[0],
            *address[1:],
        )
        assert np.array_equal(
            (wrapped.bounds.lb, wrapped.bounds.ub),
            (posed.lower_bounds, posed.upper_bounds),
        )
        assert (
            wrapped.optimum.y == 0.0
            if posed.optimum == 0.0
            else not np.isfinite(wrapped.optimum.y)
        )
        for _ in range(2):
            search = swarm(posed.space)
            for _ in range(BUDGET // 20):
                proposals = search.ask()
                search.tell(
                    proposals, np.array([wrapped(proposal) for proposal in proposals])
                )
            assert np.array_equal(posed.trace, plain.trace)
            assert wrapped.state.evaluations == posed.evaluations == BUDGET
            assert wrapped.state.current_best.y == posed.best_observed_fvalue1
            wrapped.reset()
            assert (
                wrapped.state.evaluations
                == posed.evaluations
                == len(posed.trace[0])
                == 0
            )


def test_a_log_of_iohexperimenter_names_the_suite(tmp_path: Path) -> None:
    ioh = pytest.importorskip("ioh", reason="it is in the extra test")
    logger = ioh.logger.Analyzer(root=str(tmp_path), folder_name="log")
    for number in (1, 7):
        dimension = 9 if number == 1 else 66
        wrapped = ioh_problem(problem(number, dimension=dimension))
        wrapped.attach_logger(logger)
        wrapped(np.zeros(dimension))
        wrapped.detach_logger()
    close_log(logger)
    logs = [json.loads(path.read_text()) for path in tmp_path.glob("log/*.json")]
    assert sorted(log["function_id"] for log in logs) == [26_301, 26_307]
    assert {log["suite"] for log in logs} == {SUITE}


def test_iohexperimenter_finds_the_optimum_and_keeps_a_budget() -> None:
    pytest.importorskip("ioh", reason="it is in the extra test")
    wrapped = ioh_problem(problem(budget=1))
    wrapped(wrapped.optimum.x)
    assert wrapped.state.final_target_found
    with pytest.raises(BudgetSpentError):
        wrapped(wrapped.optimum.x)


def test_cocos_own_solver_and_printer_run_on_a_suite(capsys) -> None:
    cocoex = pytest.importorskip("cocoex", reason="it is in the extra test")
    suite = posefit.Suite(functions=[1, 7], dimensions=[9, 24], instances=[10_000])
    printer = cocoex.utilities.MiniPrint()
    for problem in suite:
        cocoex.solvers.random_search(
            problem, problem.lower_bounds, problem.upper_bounds, 30
        )
        printer(problem, final=problem.index == len(suite) - 1)
        assert problem.evaluations == 30
        assert problem.best_observed_fvalue1 < 60.0
    assert "9D" in capsys.readouterr().out


def test_each_search_has_separate_random_numbers() -> None:
    first = set()
    for function, instance, seed in ((1, 17, 0), (1, 18, 0), (2, 17, 0), (1, 17, 1)):
        posed = problem(function, instance)
        run_on(posed, "random", evaluations=40, seed=seed)
        first.add(tuple(posed.points[0]))
    assert len(first) == 4
