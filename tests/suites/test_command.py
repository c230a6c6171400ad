"""`posefit suite`, and plans of single searches; mistakes are one line and status 2."""

import re
import tomllib
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.errors import InputError
from posefit.report.searches import search_run
from posefit.suites.functions import SUITE
from posefit.suites.registry import suite_registry
from posefit.suites.running import run_of, run_on, suite_scores
from posefit.sweep.cell import run_cell
from posefit.sweep.ledger import Ledger
from posefit.sweep.plan import Plan
from posefit.sweep.schema import FILE
from posefit.sweep.writer import Writer
from tests.cases import each
from tests.commands import error_of, printed, run
from tests.sweep.fake import rows_in

PLAN = """
suite = "posefit-2026.3"
methods = ["random", { method = "pso", settings = { population_size = 20 } }]
functions = [1, 7]
dimensions = [9, 24]
instances = [10000, 3]
budgets = [10]
"""


def swept(folder: Path, *plans: str) -> Path:
    """Return a folder, once the cells of plans have run into its ledger."""
    with Writer(folder / FILE) as ledger:
        for cell in [cell for plan in plans for cell in Plan.of(tomllib.loads(plan))]:
            ledger.add(cell)
            ledger.finish(cell.key, run_cell(cell))
    return folder


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a ledger of the plan's cells, as a sweep writes it."""
    return swept(tmp_path_factory.mktemp("suite") / "results", PLAN)


def test_the_functions_are_listed() -> None:
    done = run("suite")
    assert done.exit_code == 0
    assert "7  high-dimensional     d = 20, 24, 40, 66" in done.stdout
    ours = printed("suite")
    suite = ours["suites"][SUITE]
    assert [problem["id"] for problem in suite["problems"]] == list(range(1, 10))


def test_the_suite_has_the_form_of_iohs_registry() -> None:
    ioh = pytest.importorskip("ioh")
    if not hasattr(ioh, "registry"):
        pytest.skip("ioh has a registry since 0.4")
    theirs = ioh.registry()
    ours = suite_registry()
    assert ours["schema_version"] == theirs["schema_version"]
    suite = ours["suites"][SUITE]
    bbob = theirs["suites"]["BBOB"]
    assert suite.keys() == bbob.keys()
    for name, value in bbob.items():
        assert type(suite[name]) is type(value), name
        if isinstance(value, dict) and name != "scoring":
            assert suite[name].keys() == value.keys()
    for problem in suite["problems"]:
        assert problem.keys() - {"dimensions", "summary"} == bbob["problems"][0].keys()
        assert problem["optimum"].keys() == bbob["problems"][0]["optimum"].keys()


def test_a_run_prints_the_targets_that_it_reaches() -> None:
    words = (
        "run",
        "random",
        "--function",
        2,
        "--instances",
        "10000:10003",
        "--budget",
        5,
    )
    (score,) = printed("suite", *words)
    problems = posefit.Suite(
        functions=[2], dimensions=[9], instances=range(10_000, 10_003)
    )
    runs = [run_on(problem, "random", evaluations=45) for problem in problems]
    assert [one.evaluations[0] for one in runs] == [1.0, 1.0, 1.0]
    expected = {
        "method": "random",
        "function": 2,
        "dimension": 9,
        "runs": 3,
        "reached": suite_scores(runs)[0].reached,
    }
    assert {name: score[name] for name in expected} == expected


def test_a_function_without_a_chosen_dimension_is_left_out_and_named() -> None:
    done = run(
        "suite",
        "run",
        "random",
        "--function",
        1,
        "--function",
        7,
        "--instances",
        "10000:10001",
        "--budget",
        5,
    )
    assert done.exit_code == 0, done.stderr
    assert "function 7 is left out: it has dimensions 20, 24, 40, 66" in done.stderr
    assert "1 single image" in done.stdout


def test_scores_follow_from_the_traces() -> None:
    problems = posefit.Suite(functions=[1], dimensions=[9], instances=[1, 2, 3])
    runs = [run_on(problem, "random", evaluations=100, seed=4) for problem in problems]
    (score,) = suite_scores(runs)
    reached = [
        (run.costs[-1] <= run.truth_cost + 2.0 ** (5 - k / 4))
        for run in runs
        for k in range(29)
    ]
    assert score.reached == pytest.approx(np.mean(reached))
    assert score.above == np.median([run.costs[-1] - run.truth_cost for run in runs])
    hits = [run.evaluations[run.costs <= run.truth_cost + 16.0][:1] for run in runs]
    used = sum(hit.sum() if len(hit) else 100 for hit in hits)
    count = sum(map(len, hits))
    assert score.running_times[16.0] == (pytest.approx(used / count) if count else None)


def test_methods_that_look_are_marked_and_come_after_blind_ones() -> None:
    runs = []
    for function in (2, 3, 4, 5):
        for looks in (True, False):
            problem = posefit.suite(
                function=function, dimension=10 if function == 5 else 9, budget=1
            )
            views = problem.look() if looks else []
            problem(problem.made.truth if looks else np.zeros(problem.dimension))
            runs.append(run_of(problem, "mine"))
            for camera, mask in (view for frame in views for view in frame):
                assert mask.shape == (camera.height, camera.width)
                assert mask.any()
            assert [len(frame) for frame in views] == {
                2: [1],
                3: [2],
                4: [1],
                5: [1] * 8,
            }[function] * looks
    for dimension in (9, 10):
        named = [
            (score.method, score.looked)
            for score in suite_scores(runs)
            if score.dimension == dimension
        ]
        assert named == [("mine", False), ("mine (looks)", True)] * (len(named) // 2)


@each("infeasible", ["repair", "reject", "penalise"])
def test_any_loop_makes_a_run_whose_improvements_cost_the_same_again(
    infeasible: Any,
) -> None:
    problem = posefit.suite(
        function=1, instance=10_000, budget=200, infeasible=infeasible
    )
    assert [len(part) for part in problem.trace] == [0, 0]
    rng = np.random.default_rng(5)
    proposals = rng.uniform(-1.2, 1.2, (100, 9)) * rng.uniform(0.2, 1.0, (100, 1))
    costs = np.append(
        problem(proposals[:60]), [problem(proposal) for proposal in proposals[60:]]
    )
    falls = [k for k in range(100) if costs[k] < min([np.inf, *costs[:k]])]
    run = run_of(problem, "my own", {"width": 1.2}, seed=7)
    assert np.array_equal(
        run.evaluations, [*(k + 1.0 for k in falls), 100.0][: len(run.evaluations)]
    )
    assert np.array_equal(run.costs[: len(falls)], costs[falls])
    assert problem.points.shape == (len(falls), 9)
    again = posefit.suite(function=1, instance=10_000, infeasible=infeasible)
    assert np.array_equal(again(problem.points), costs[falls])
    expected = (
        proposals[falls]
        if infeasible == "penalise"
        else problem.repaired(proposals[falls])
    )
    assert np.array_equal(problem.points, expected)
    assert np.array_equal(problem.best, problem.repaired(proposals[falls[-1:]])[0])


def test_a_run_without_a_budget_or_beyond_it_is_no_run() -> None:
    problem = posefit.suite(function=1, instance=10_000)
    problem(np.zeros((3, 9)))
    for budget, reason in (
        (None, "budget must be given"),
        (2, "evaluations must be at most 2, the budget, got 3"),
    ):
        with pytest.raises(InputError, match=reason):
            run_of(problem, "my own", budget=budget)


def test_runs_with_another_budget_or_way_with_infeasible_proposals_are_not_taken_together() -> (
    None
):
    def runs_of(budget: int, infeasible: Any) -> list[Any]:
        problems = [
            posefit.suite(function=1, instance=n, infeasible=infeasible) for n in (3, 4)
        ]
        return [run_on(problem, "random", evaluations=budget) for problem in problems]

    runs = {
        way: runs_of(*way) for way in ((45, "repair"), (90, "repair"), (90, "penalise"))
    }
    scores = {
        (score.budget, score.infeasible): score
        for score in suite_scores(chain(*runs.values()))
    }
    assert set(scores) == set(runs)
    for way, score in scores.items():
        assert (score.method, score.runs) == ("random", 2)
        assert score.above == np.median(
            [one.cost - one.truth_cost for one in runs[way]]
        )


def test_the_ledger_of_a_plan_has_the_runs_that_run_on_has(results: Path) -> None:
    runs = [search_run(row) for row in rows_in(results)]
    assert (
        len({(run.method, run.function, run.dimension, run.instance) for run in runs})
        == len(runs)
        == 12
    )
    problem = posefit.suite("posefit-2026.3", 1, 3, 9)
    expected = run_on(problem, "pso", {"population_size": 20}, evaluations=90)
    (mine,) = [
        run
        for run in runs
        if (run.method, run.function, run.dimension, run.instance) == ("pso", 1, 9, 3)
    ]
    for name in ("evaluations", "costs", "targets"):
        assert np.array_equal(getattr(mine, name), getattr(expected, name))
    scores = suite_scores(runs)
    parts = [(9, 1), (24, 0), (24, 1), (24, 7)]
    assert [(score.dimension, score.function) for score in scores] == [
        part for part in parts for _ in range(2)
    ]
    # the hardest would decide them
    assert all(score.running_times == {} for score in scores if score.function == 0)
    of_random = {
        (score.function, score.dimension): score
        for score in scores
        if score.method == "random"
    }
    together, *others = [of_random[function, 24] for function in (0, 1, 7)]
    assert together.runs == 4
    assert together.reached == pytest.approx(
        np.mean([score.reached for score in others])
    )


def test_the_ledger_is_a_table(results: Path) -> None:
    with Ledger(results) as ledger:
        table = ledger.frame()
    assert (len(table), set(table["function"]), set(table["settings"])) == (
        12,
        {1, 7},
        {"", "population_size=20"},
    )
    problems = table[["function", "dimension", "instance"]].to_numpy().tolist()
    assert problems == sorted(problems)


@each(
    ("words", "message"),
    [
        (["run", "sapsoo"], "optimiser must be one of .*, got 'sapsoo'; did you mean 'sapso'"),
        (["run", "sapso", "--function", 1, "--dimension", 66], r"at least one problem, got none in \[66\] dimensions"),
        (["run", "sapso", "--instances", "5:2"], "--instances must be A:B with 0 <= A < B <= 20000, got 5:2"),
        (["run", "sapso", "--budget", 0], "budget must be at least 1, got 0"),
        (["run", "sapso", "--budget", 4], "evaluations must be at least 40, one population, got 36"),
        (["run", "sapso", "--set", "foo=1"], "a setting of sapso must be one of .*, got 'foo'"),
    ],
)  # fmt: skip
def test_a_mistake_is_reported_in_one_line_and_status_2(
    words: list[Any], message: str, tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    line = error_of("suite", *words)
    assert re.search(message, line), line
    assert list(tmp_path.iterdir()) == []


@each(
    ("change", "message"),
    [
        (
            {"motions": ["walk"]},
            "a key of a plan of a suite must be one of suite, .*, methods, .*, got 'motions'",
        ),
        ({"methods": []}, "methods must contain at least one, got none"),
        ({"methods": ["sapso@pca"]}, "optimiser must be one of .*, got 'sapso@pca'"),
        (
            {"methods": [{"method": "pso", "colour": 1}]},
            "a key of a cell must be one of suite, .*, got 'colour'",
        ),
        (
            {"methods": [{"method": "pso", "settings": {"particle": 2}}]},
            "a setting of pso must be one of",
        ),
        (
            {"budgets": [4]},
            "evaluations must be at least 40, one population, got 36 of sapso",
        ),
        ({"seeds": [1, 1]}, "the cells of a plan must differ, got sapso on f1"),
        (
            {"dimensions": [66]},
            "functions must exist in one of the plan's dimensions, got 1,",
        ),
    ],
)
def test_a_mistake_in_a_plan_is_named_before_anything_runs(
    change: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        Plan.of(
            {
                "suite": "posefit-2026.3",
                "methods": ["sapso"],
                "functions": [1],
                **change,
            }
        )
