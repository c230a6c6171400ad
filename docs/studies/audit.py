"""Checks of what methods report on a suite, and the best costs they reach, which `posefit/suites/known.json` holds.

Every method of a list searches each problem at its usual budget. The cost of its best proposal is then computed again,
against new cameras and silhouettes; and it may not be below the optimum. The strongest method, CMA-ES, searches once
more with a hundred times the budget: the best cost of all is the best known.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import click
import numpy as np

from posefit.files import check_new, new_file
from posefit.suites.functions import HELD_OUT
from posefit.suites.instances import suite_instance
from posefit.suites.problem import EVALUATIONS, Problem, Suite, suite
from posefit.suites.running import run_on
from table import bar

METHODS = ("random", "sapso", "pso", "cma", "annealed", "scipy")
STRONGEST, TIMES = "cma", 100  # of the longest search, and its budget in usual ones
TOLERANCE = 1e-9  # of a cost, whose terms are added in another order


@dataclass(frozen=True)
class Audited:
    """The results of one problem."""

    problem: str
    truth_cost: float
    costs: dict[str, float]  # the best cost by method; `STRONGEST x TIMES` is the long search
    faults: tuple[str, ...] = field(default=())  # what was wrong, in words

    @property
    def best(self) -> float:
        """The least cost of all, the truth's among them."""
        return min(self.truth_cost, *self.costs.values())


def audited(problems: Suite, methods: Sequence[str] = METHODS, *, times: int = TIMES) -> Iterator[Audited]:
    """Yield the results of each problem; with `times` of 0 there is no longer search."""
    for problem in problems:
        costs, faults = {}, []
        plans = [(method, method, 1) for method in methods]
        for label, method, factor in [*plans, (f"{STRONGEST} x {times}", STRONGEST, times)][: len(plans) + bool(times)]:
            fresh = suite(problem.suite, problem.id_function, problem.instance, problem.dimension)
            run_on(fresh, method, evaluations=factor * EVALUATIONS * problem.dimension)
            costs[label] = fresh.best_observed_fvalue1
            faults += [f"{label}: {fault}" for fault in reported_faults(fresh)]
        yield Audited(problem.id, problem.truth_cost, costs, tuple(faults))


def reported_faults(problem: Problem) -> list[str]:
    """Return what is wrong with the best proposal and the trace of a problem that was searched."""
    made = suite_instance.__wrapped__(problem.id_function, problem.instance, problem.dimension)  # not the cached one
    best, cost = problem.best[None], problem.best_observed_fvalue1
    poses, translations = made.posed.decode(best)
    shares = [
        0.5 * _share(missed, both) + 0.5 * _share(spilled, both)
        for missed, spilled, both in (view[0].tolist() for view in made.posed.areas(poses, translations))
    ]
    faults = []
    if abs((again := 100.0 * float(np.mean(shares))) - cost) > TOLERANCE:
        faults.append(f"the best proposal must cost what was reported, {cost!r}, got {again!r}")
    if not made.posed.space.feasible(best)[0]:
        faults.append("the best proposal must be feasible, got one that is not")
    if problem.optimum is not None and cost < problem.optimum:
        faults.append(f"no cost may be below the optimum, {problem.optimum}, got {cost!r}")
    used, costs = problem.trace
    if used[0] < 1 or used[-1] != problem.evaluations or (np.diff(costs) > 0.0).any() or costs[-1] != cost:
        faults.append("the trace must fall to the best cost and end with the last evaluation, got another")
    return faults


def _share(wrong: int, both: int) -> float:
    return wrong / (wrong + both) if wrong + both else 1.0


def audit_lines(rows: Sequence[Audited]) -> list[str]:
    """Return the lines of a table, for a terminal: faults, and how far above the best of all each method ends."""
    labels = list(rows[0].costs)
    lines = [f"{'problem':38} {'truth':>8} {'best':>8}" + "".join(f" {label:>10}" for label in labels)]
    for row in rows:
        lines.append(
            f"{row.problem:38} {row.truth_cost:>8.3f} {row.best:>8.3f}"
            + "".join(f" {row.costs[label] - row.best:>+10.3f}" for label in labels)
        )
    medians = [np.median([row.costs[label] - row.best for row in rows]) for label in labels]
    lines.append(f"{'median above the best':56}" + "".join(f" {value:>+10.3f}" for value in medians))
    faults = [f"{row.problem}: {fault}" for row in rows for fault in row.faults]
    return [*lines, *faults, f"{len(rows)} problems, {len(rows) * len(labels)} searches, {len(faults)} faults"]


def known_json(rows: Sequence[Audited], methods: Sequence[str], times: int) -> dict[str, Any]:
    """Return the contents of known.json: methods and budgets, the number of problems, the best costs.

    `methods` and `times` are those of `audited`.
    """
    usual = f"{', '.join(methods)} with the usual"
    return {
        "made_by": f"{STRONGEST} with {times} times the usual budget, and {usual} one" if times else f"{usual} budget",
        "problems": len(rows),
        "best": {row.problem: row.best for row in rows if row.best < row.truth_cost},
    }


@click.command(help=__doc__)
@click.option("--function", "functions", type=int, multiple=True, help="Its number; repeatable, by default each.")
@click.option("--dimension", "dimensions", type=int, multiple=True, default=(9,), help="Repeatable, by default 9.")
@click.option("--instances", type=int, default=3, show_default=True, help="Of each function, held out ones.")
@click.option("--method", "methods", multiple=True, default=METHODS, help="Searches with the usual budget; repeatable.")
@click.option("--times", type=int, default=TIMES, show_default=True, help="How much longer CMA-ES searches; 0 for not.")
@click.option("--write", metavar="FILE", help="New file of the best costs, as known.json of the suite.")
@click.pass_context
def main(
    context: click.Context,
    functions: tuple[int, ...],
    dimensions: tuple[int, ...],
    instances: int,
    methods: tuple[str, ...],
    times: int,
    write: str | None,
) -> None:
    if write is not None:
        check_new(write)
    problems = Suite(functions=functions or None, dimensions=dimensions, instances=HELD_OUT[:instances])
    rows = list(bar(audited(problems, methods, times=times), len(problems)))
    if write is not None:
        with new_file(write) as building:
            building.write_text(json.dumps(known_json(rows, methods, times), indent=1) + "\n", encoding="utf-8")
    click.echo("\n".join(audit_lines(rows)))
    context.exit(1 if any(row.faults for row in rows) else 0)


if __name__ == "__main__":
    main()
