"""Reported costs are true, wrong ones are noticed, and the best ones become the suite's file."""

import json
import re
from pathlib import Path

from click.testing import CliRunner

import audit
import posefit
from posefit.suites.problem import Suite
from posefit.suites.running import run_on


def test_no_built_in_method_reports_below_the_optimum_or_another_cost_than_its_proposal_has() -> None:
    problems = Suite(functions=[1, 2, 4, 5, 8], dimensions=[9], instances=[10_001])
    rows = list(audit.audited(problems, audit.METHODS, times=0))
    assert len(rows) == 5
    assert all(set(row.costs) == set(audit.METHODS) for row in rows)
    assert [fault for row in rows for fault in row.faults] == []


def test_a_wrong_cost_is_reported() -> None:
    problem = posefit.suite("posefit-2026.1", 1, 10_000, 9)
    run_on(problem, "random", evaluations=50)
    assert audit.reported_faults(problem) == []
    problem.best_observed_fvalue1 -= 30.0
    faults = audit.reported_faults(problem)
    assert re.match(r"the best proposal must cost what was reported, -?\d", faults[0])
    assert any("no cost may be below the optimum, 0.0" in fault for fault in faults)
    assert any("the trace must fall to the best cost" in fault for fault in faults)


def test_the_best_costs_are_written_to_a_new_file(tmp_path: Path) -> None:
    words = [
        "--function",
        "5",
        "--instances",
        "2",
        "--method",
        "cma",
        "--times",
        "5",
        "--write",
        str(tmp_path / "best"),
    ]
    done = CliRunner().invoke(audit.main, words)
    assert done.exit_code == 0, done.output
    assert done.stdout.splitlines()[-1] == "2 problems, 4 searches, 0 faults"
    known = json.loads((tmp_path / "best").read_text("utf-8"))
    assert known["problems"] == 2
    assert known["made_by"] == "cma with 5 times the usual budget, and cma with the usual one"
    for name, cost in known["best"].items():
        instance = int(re.search(r"_i(\d+)_", name)[1])  # type: ignore[index]
        assert cost < posefit.suite("posefit-2026.1", 5, instance, 9).truth_cost
