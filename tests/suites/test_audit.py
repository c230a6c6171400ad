"""Reported costs are true, and the best costs of the file are costs of known proposals."""

import json
import re
from pathlib import Path

from click.testing import CliRunner

import posefit
from posefit.cli import main
from posefit.suites.audit import METHODS, audited, reported_faults
from posefit.suites.problem import Suite, best_known_of, known_file
from posefit.suites.running import run_on


def test_no_built_in_method_reports_below_the_optimum_or_another_cost_than_its_proposal_has() -> None:
    problems = Suite(functions=[1, 2, 4, 5, 8], dimensions=[9], instances=[10_001])
    rows = list(audited(problems, METHODS, times=0))
    assert len(rows) == 5
    assert all(set(row.costs) == set(METHODS) for row in rows)
    assert [fault for row in rows for fault in row.faults] == []


def test_a_wrong_cost_is_reported() -> None:
    problem = posefit.suite("posefit-2026.1", 1, 10_000, 9)
    run_on(problem, "random", evaluations=50)
    assert reported_faults(problem) == []
    problem.best_observed_fvalue1 -= 30.0
    faults = reported_faults(problem)
    assert re.match(r"the best proposal must cost what was reported, -?\d", faults[0])
    assert any("no cost may be below the optimum, 0.0" in fault for fault in faults)
    assert any("the trace must fall to the best cost" in fault for fault in faults)


def test_the_file_names_problems_of_the_suite_and_costs_below_their_truths() -> None:
    best = known_file()["best"]
    for name, cost in list(best.items())[::9]:
        function, instance, dimension = map(int, re.fullmatch(r"posefit-2026.1_f(\d+)_i(\d+)_d(\d+)", name).groups())  # type: ignore[union-attr]
        problem = posefit.suite("posefit-2026.1", function, instance, dimension)
        assert problem.id == name
        assert 0.0 <= cost == best_known_of(name) == problem.best_known < problem.truth_cost
        assert problem.targets[-1] == cost + 0.25
    assert best_known_of("posefit-2026.1_f001_i00000_d09") is None


def test_what_is_best_known_never_rises_and_no_problem_goes() -> None:
    usual = "random, sapso, pso, cma, annealed, scipy with the usual one"
    assert known_file()["made_by"] == f"cma with 100 times the usual budget, and {usual}"
    best = known_file()["best"]
    assert len(best) >= 151  # in the suite's first version
    first = {"f004_i10000_d09": 7.427, "f005_i10000_d09": 0.9715, "f005_i10001_d40": 0.9295, "f008_i10000_d40": 0.2070}
    for name, cost in first.items():
        assert best[f"posefit-2026.1_{name}"] <= cost


def test_the_command_writes_the_best_costs_and_keeps_what_is_there(tmp_path: Path) -> None:
    words = ["suite", "audit", "--function", "5", "--instances", "3:5", "--method", "cma", "--times", "5"]
    words += ["--write", str(tmp_path / "known.json")]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 0, done.output
    assert done.stdout.splitlines()[-1] == "2 problems, 4 searches, 0 faults"
    known = json.loads((tmp_path / "known.json").read_text("utf-8"))
    truths = {f"posefit-2026.1_f005_i{n:05d}_d09": posefit.suite("posefit-2026.1", 5, n, 9).truth_cost for n in (3, 4)}
    assert known["problems"] == 2
    assert known["made_by"] == "cma with 5 times the usual budget, and cma with the usual one"
    assert known["best"]
    assert all(cost < truths[name] for name, cost in known["best"].items())
    again = CliRunner().invoke(main, words)
    assert again.exit_code == 2
    assert "expected a new name to write to, got one that exists" in again.stderr
