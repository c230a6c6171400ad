"""Problems in other tools: each tool's own loop and checker runs on them, with the costs and the trace of a plain loop."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

import posefit
from posefit import Problem

ROOT = Path(__file__).parents[2]
SENT = ROOT / "docs" / "contributions"


def problem(function: int = 1, **more: object) -> Problem:
    return posefit.suite("posefit-2026.3", function, 10_000, 9, **more)


def check(
    searched: Problem, proposals: Iterable[object], costs: Iterable[float]
) -> None:
    """Check that a plain loop over proposals has the same costs, and then the same trace, to the last bit."""
    plain = problem(searched.id_function)
    own = np.array([plain(proposal) for proposal in proposals])
    assert np.array_equal(own, np.asarray(costs))
    assert np.array_equal(searched.trace, plain.trace)
    assert searched.evaluations == len(own)


def test_a_study_of_optuna_has_the_trace_of_a_plain_loop() -> None:
    optuna = pytest.importorskip("optuna")
    pytest.importorskip("optunahub")
    from posefit_bridges.problems import optunahub_problem

    posed = optunahub_problem(problem())
    study = optuna.create_study(
        sampler=optuna.samplers.RandomSampler(seed=0), directions=posed.directions
    )
    study.optimize(posed, n_trials=30)
    assert set(study.trials[0].params) == set(posed.search_space)
    check(
        posed.problem,
        [list(trial.params.values()) for trial in study.trials],
        [t.value for t in study.trials],
    )


def test_optunahubs_loader_takes_the_folder_that_is_ready_to_be_sent() -> None:
    optunahub = pytest.importorskip("optunahub")
    module = optunahub.load_local_module(
        "benchmarks/posefit", registry_root=str(SENT / "optunahub" / "package")
    )
    posed = module.Problem(function=1, instance=10_000, dimension=9)
    assert isinstance(posed, optunahub.benchmarks.BaseProblem)
    assert posed.evaluate(dict.fromkeys(posed.search_space, 0.0)) == problem()(
        np.zeros(9)
    )
    with pytest.raises(ValueError, match="instance must lie in 0 to 19999, got 20000"):
        module.Problem(instance=20_000)


def test_pymoo_minimises_with_the_trace_of_a_plain_loop() -> None:
    pytest.importorskip("pymoo")
    from pymoo.algorithms.soo.nonconvex.pso import PSO
    from pymoo.optimize import minimize

    from posefit_bridges.problems import pymoo_problem

    seen: list[tuple[np.ndarray, np.ndarray]] = []
    posed = pymoo_problem(problem())
    posed.callback = lambda proposals, out: seen.append((proposals, out["F"][:, 0]))
    result = minimize(posed, PSO(pop_size=10), ("n_eval", 50), seed=1)
    check(
        posed.problem,
        np.concatenate([x for x, _ in seen]),
        np.concatenate([f for _, f in seen]),
    )
    assert result.F[0] == posed.problem.best_observed_fvalue1
    assert np.array_equal(posed.pareto_front(), [[0.0]])
    assert pymoo_problem(problem(8)).pareto_front() is None


def test_an_optimiser_of_nevergrad_has_the_trace_of_a_plain_loop() -> None:
    nevergrad = pytest.importorskip("nevergrad")
    from posefit_bridges.problems import nevergrad_function

    posed = nevergrad_function(1, 10_000, 9).copy()
    posed.parametrization.random_state = np.random.RandomState(0)
    optimiser = nevergrad.optimizers.OnePlusOne(posed.parametrization, budget=30)
    seen = []
    optimiser.register_callback(
        "tell", lambda _, candidate, cost: seen.append((candidate.value, cost))
    )
    optimiser.minimize(posed)
    check(posed.problem, [x for x, _ in seen], [cost for _, cost in seen])
    # an experiment's copy counts for itself
    assert posed.copy().problem.evaluations == 0
    assert posed.descriptors["function"] == 1
