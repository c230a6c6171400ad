"""Loops of COCO, IOHexperimenter and Nevergrad run on a problem as they are, with the same trace."""

from pathlib import Path

import numpy as np
import pytest

import posefit
from posefit.suites.problem import Problem

ADDRESSES = [(1, 10_003, 9), (4, 12_345, 16), (7, 2, 66)]
BUDGET = 400


def swarm(space: posefit.Space) -> posefit.Optimiser:
    return posefit.optimiser("pso")(space, np.random.default_rng(1), population_size=20)


def problems() -> list[Problem]:
    return [posefit.suite("posefit-2026.1", *address) for address in ADDRESSES]


@pytest.fixture(scope="module")
def traces() -> list[tuple[np.ndarray, np.ndarray]]:
    """Return a swarm's trace on each problem, driven by posefit's own loop, in populations."""
    traces = []
    for problem in problems():
        result = posefit.minimise(problem.evaluate, swarm(problem.space), BUDGET)
        assert result.cost == problem.best_observed_fvalue1 == problem.trace[1][-1]
        assert problem.evaluations == BUDGET
        traces.append(problem.trace)
    return traces


def one_by_one(function, optimiser, budget):
    """Drive an optimiser on a function of one proposal."""
    for _ in range(budget // 20):
        proposals = optimiser.ask()
        optimiser.tell(proposals, np.array([function(proposal) for proposal in proposals]))


def test_a_loop_like_cocos_has_the_same_trace(traces) -> None:
    for (function, instance, dimension), expected in zip(ADDRESSES, traces, strict=True):
        suite = posefit.Suite("posefit-2026.1", functions=[function], dimensions=[dimension], instances=[instance])
        for problem in suite:  # as in COCO's example experiment
            assert problem.evaluations == 0
            assert len(problem.lower_bounds) == len(problem.upper_bounds) == problem.number_of_variables == dimension
            one_by_one(problem, swarm(problem.space), BUDGET)
            assert problem.evaluations == BUDGET
            assert not problem.final_target_hit
            assert np.array_equal(problem.trace, expected)


def test_iohexperimenter_logs_the_same_trace(traces, tmp_path: Path) -> None:
    ioh = pytest.importorskip("ioh", reason="it has no wheels for every Python")
    for problem, expected in zip(problems(), traces, strict=True):
        wrapped = ioh.wrap_problem(
            problem, problem.id, ioh.ProblemClass.REAL, problem.dimension, problem.instance, lb=-1, ub=1
        )
        logger = ioh.logger.Analyzer(root=str(tmp_path), folder_name=problem.id, algorithm_name="PSO")
        wrapped.attach_logger(logger)
        one_by_one(wrapped, swarm(problem.space), BUDGET)
        wrapped.detach_logger()
        logger.close()
        assert np.array_equal(problem.trace, expected)
        assert wrapped.state.evaluations == problem.evaluations == BUDGET
        assert wrapped.state.current_best.y == problem.best_observed_fvalue1
        rows = next((tmp_path / problem.id).rglob("*.dat")).read_text("ascii").splitlines()[1:]
        logged = [(float(used), float(cost)) for used, cost in (row.split() for row in rows)]
        falls = np.flatnonzero(np.diff(expected[1], prepend=np.inf) < 0.0)
        assert logged[: len(falls)] == [
            (expected[0][k], pytest.approx(expected[1][k], abs=1e-9)) for k in falls
        ]  # it logs a row where the cost falls, and the last one


def test_cocos_own_solver_and_printer_run_on_a_suite(capsys) -> None:
    cocoex = pytest.importorskip("cocoex", reason="it is in the extra test")
    suite = posefit.Suite(functions=[1, 7], dimensions=[9, 24], instances=[10_000])
    printer = cocoex.utilities.MiniPrint()
    for problem in suite:
        cocoex.solvers.random_search(problem, problem.lower_bounds, problem.upper_bounds, 30)
        printer(problem, final=problem.index == len(suite) - 1)
        assert problem.evaluations == 30
        assert problem.best_observed_fvalue1 < 60.0
    assert "9D" in capsys.readouterr().out
