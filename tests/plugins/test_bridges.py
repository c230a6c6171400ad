"""Problems in other tools: each tool's own loop and checker runs on them, with the costs and the trace of a plain loop."""

import importlib.util
import os
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import posefit
from posefit.suites.problem import Problem

ROOT = Path(__file__).parents[2]
SENT = ROOT / "docs" / "contributions"
PATHS = os.pathsep.join(map(str, (ROOT, ROOT / "plugins")))
RANDOM_SEARCH = """
import numpy as np

class RandomSearch:
    def __init__(self, budget, dim):
        self.budget, self.dim = budget, dim

    def __call__(self, func):
        rng = np.random.default_rng(0)
        return min((func(x), x.tolist()) for x in rng.uniform(-1.0, 1.0, (self.budget, self.dim)))
"""


def problem(function: int = 1, **more: object) -> Problem:
    return posefit.suite("posefit-2026.3", function, 10_000, 9, **more)  # type: ignore[arg-type]


def check(searched: Problem, proposals: Iterable[object], costs: Iterable[float], precision: type = np.float64) -> None:
    """Check that a plain loop over proposals has the same costs, and then the same trace, to the last bit."""
    plain = problem(searched.id_function)
    own = np.array([plain(proposal) for proposal in proposals])
    assert np.array_equal(own.astype(precision), np.asarray(costs))
    assert np.array_equal(searched.trace, plain.trace)
    assert searched.evaluations == len(own)


def test_a_study_of_optuna_has_the_trace_of_a_plain_loop() -> None:
    optuna = pytest.importorskip("optuna")
    pytest.importorskip("optunahub")
    from posefit_bridges.optunahub import Problem

    posed = Problem(problem())
    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0), directions=posed.directions)
    study.optimize(posed, n_trials=30)
    assert set(study.trials[0].params) == set(posed.search_space)
    check(posed.problem, [list(trial.params.values()) for trial in study.trials], [t.value for t in study.trials])


def test_optunahubs_loader_takes_the_folder_that_is_ready_to_be_sent() -> None:
    optunahub = pytest.importorskip("optunahub")
    module = optunahub.load_local_module("benchmarks/posefit", registry_root=str(SENT / "optunahub" / "package"))
    posed = module.Problem(function=1, instance=10_000, dimension=9)
    assert isinstance(posed, optunahub.benchmarks.BaseProblem)
    assert posed.evaluate(dict.fromkeys(posed.search_space, 0.0)) == problem()(np.zeros(9))
    with pytest.raises(ValueError, match="instance must be at most 19999, got 20000"):
        module.Problem(instance=20_000)


def test_pymoo_minimises_with_the_trace_of_a_plain_loop() -> None:
    pytest.importorskip("pymoo")
    from pymoo.algorithms.soo.nonconvex.pso import PSO
    from pymoo.optimize import minimize

    from posefit_bridges.pymoo import Problem

    seen: list[tuple[np.ndarray, np.ndarray]] = []
    posed = Problem(problem())
    posed.callback = lambda proposals, out: seen.append((proposals, out["F"][:, 0]))
    result = minimize(posed, PSO(pop_size=10), ("n_eval", 50), seed=1)
    check(posed.problem, np.concatenate([x for x, _ in seen]), np.concatenate([f for _, f in seen]))
    assert result.F[0] == posed.problem.best_observed_fvalue1
    assert np.array_equal(posed.pareto_front(), [[0.0]])
    assert Problem(problem(8)).pareto_front() is None


def test_an_optimiser_of_nevergrad_has_the_trace_of_a_plain_loop() -> None:
    nevergrad = pytest.importorskip("nevergrad")
    from posefit_bridges.nevergrad import Problem

    posed = Problem(1, 10_000, 9).copy()
    posed.parametrization.random_state = np.random.RandomState(0)
    optimiser, seen = nevergrad.optimizers.OnePlusOne(posed.parametrization, budget=30), []
    optimiser.register_callback("tell", lambda _, candidate, cost: seen.append((candidate.value, cost)))
    optimiser.minimize(posed)
    check(posed.problem, [x for x, _ in seen], [cost for _, cost in seen])
    assert posed.copy().problem.evaluations == 0  # an experiment's copy counts for itself
    assert posed.descriptors["function"] == 1


@pytest.mark.slow
def test_nevergrads_benchmark_command_runs_the_plan(tmp_path: Path) -> None:
    for library in ("torchvision", "pyproj", "gym"):
        if importlib.util.find_spec(library) is None:
            pytest.skip(f"no {library}, which nevergrad.benchmark imports")
    plan = ROOT / "plugins" / "posefit_bridges" / "nevergrad_plan.py"
    command = ["-m", "nevergrad.benchmark", "posefit_suite", "--seed=1", "--cap_index=2", f"--imports={plan}"]
    paths = os.pathsep.join((PATHS, os.environ.get("PYTHONPATH", "")))
    subprocess.run([sys.executable, *command], cwd=tmp_path, env={**os.environ, "PYTHONPATH": paths}, check=True)
    head, *rows = [line.split(",") for line in (tmp_path / "posefit_suite.csv").read_text("utf-8").splitlines()]
    assert [row[head.index("error")] for row in rows] == ["", ""]
    assert all(0.0 <= float(row[head.index("loss")]) < 40.0 for row in rows)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_workflow_of_evox_has_the_trace_of_a_plain_loop() -> None:
    torch = pytest.importorskip("torch")
    pytest.importorskip("evox")
    from evox.algorithms import PSO
    from evox.workflows import EvalMonitor, StdWorkflow

    from posefit_bridges.evox import Problem

    torch.manual_seed(0)
    posed, monitor = Problem(problem()), EvalMonitor(full_sol_history=True)
    flow = StdWorkflow(PSO(20, -torch.ones(9), torch.ones(9)), posed, monitor)
    flow.init_step()
    flow.step()
    torch.compile(flow.step, backend="eager")()
    proposals = torch.cat(list(monitor.solution_history))
    assert proposals.dtype == torch.float32
    check(posed.problem, proposals.double().numpy(), torch.cat(list(monitor.fitness_history)).numpy(), np.float32)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_iohblade_scores_code_by_the_area_over_its_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    iohblade = pytest.importorskip("iohblade")
    from posefit_bridges.blade import Problem

    posed = Problem(training_instances=[(1, 10_000, 9)], test_instances=[(1, 10_000, 9), (8, 3, 9)], budget_factor=20)
    solution = posed.evaluate(iohblade.Solution(code=RANDOM_SEARCH, name="RandomSearch"))
    plain = problem()
    costs = plain(np.random.default_rng(0).uniform(-1.0, 1.0, (180, 9)))
    height = (np.log10(np.clip(np.minimum.accumulate(costs), 0.25, 32.0)) - np.log10(0.25)) / np.log10(128.0)
    assert solution.fitness == pytest.approx(1.0 - height[:-1].sum() / 180, abs=1e-12)
    assert len(posed.test(solution).get_metadata("aucs")) == 2
    spends = iohblade.Solution(code=RANDOM_SEARCH.replace("(self.budget,", "(9 * self.budget,"), name="RandomSearch")
    assert posed.evaluate(spends).fitness == solution.get_metadata("aucs")[0]
    assert {"tags", "name", "prompt", "minimisation", "evaluator", "config"} <= set(posed.get_config())

    # BLADE's own process, in an environment of its own, which takes the libraries of this one
    monkeypatch.setenv("PYTHONPATH", PATHS)
    posed.dependencies = []
    try:
        own = posed(iohblade.Solution(code=RANDOM_SEARCH, name="RandomSearch"))
        assert (own.error, own.get_metadata("aucs")) == ("", spends.get_metadata("aucs"))
        assert "NameError" in posed(iohblade.Solution(code="no_such_name", name="RandomSearch")).error
    finally:
        posed.cleanup()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("version", ["numpy", "torch"])
def test_metaboxs_own_episode_has_the_trace_of_a_plain_loop(version: str) -> None:
    pytest.importorskip("metaevobox")
    import torch
    from metaevobox.baseline.bbo.random_search import Random_search
    from metaevobox.tester import BBO_TestUnit

    from posefit_bridges.metabox import Dataset

    train, test = Dataset.get_datasets(version, instances=2, test_batch_size=3)  # type: ignore[arg-type]
    assert [one.problem.instance for one in train.data] == [0, 1] * 5
    assert [len(batch) for batch in test] == [3, 3, 3, 1]
    assert len(train + test) == 20
    posed = test[0][0]
    settings = SimpleNamespace(maxFEs=300, n_logpoint=5, log_interval=60, full_meta_data=True, device="cpu")
    optimiser = Random_search(settings)
    optimiser.test_name = "random"
    if version == "torch":  # MetaBox's optimisers of numpy give arrays
        posed.eval = lambda x, own=posed.eval: own(torch.as_tensor(x)).numpy()
    episode = BBO_TestUnit(optimiser, posed, 1).run_batch_episode()
    assert (episode["problem_name"], episode["fes"]) == ("posefit-2026.3_f001_i10000_d09", 300)
    check(posed.problem, np.concatenate(episode["metadata"]["X"]), np.concatenate(episode["metadata"]["Cost"]))
