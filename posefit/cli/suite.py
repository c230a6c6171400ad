"""`posefit suite`."""

from typing import TYPE_CHECKING, Any

import click

from posefit.cli.options import Decorator, options, parsed_by
from posefit.cli.output import json_line, progress, results_alone, say
from posefit.errors import InputError
from posefit.tracking.options import text_range

if TYPE_CHECKING:
    from posefit.suites.running import SuiteRun

NAME = "posefit-2026.1"


def _problem_options(instances: str) -> Decorator:
    """Return a decorator that adds the options which select problems."""
    numbers: dict[str, Any] = {"type": int, "multiple": True}
    span: dict[str, Any] = {"default": instances, "show_default": True, "metavar": "A:B"}
    return options(
        (
            click.option("--function", "functions", help="Its number; repeatable, by default each.", **numbers),
            click.option("--dimension", "dimensions", help="Repeatable, by default 9.", **numbers),
            click.option("--instances", callback=parsed_by(text_range), help="A to B - 1.", **span),
        )
    )


@click.group(invoke_without_command=True)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON array.")
@click.pass_context
def suite(context: click.Context, as_json: bool) -> None:
    """List the functions of the numbered benchmark, and their dimensions."""
    if context.invoked_subcommand is not None:
        return
    from dataclasses import asdict

    from posefit.suites.functions import FUNCTIONS, HELD_OUT, SUITE, TRAINING

    if as_json:
        click.echo(json_line([asdict(one) for one in FUNCTIONS]))
        return
    click.echo(f"{SUITE}: proposals in [-1, 1]^d, costs of 0 to 100")
    click.echo(f"instances {TRAINING[0]} to {TRAINING[-1]} for training, {HELD_OUT[0]} to {HELD_OUT[-1]} held out\n")
    for one in FUNCTIONS:
        dimensions = ", ".join(map(str, one.dimensions))
        click.echo(f"  {one.number}  {one.name:20} d = {dimensions:14} {one.summary}")


@suite.command("run")
@click.argument("optimiser")
@_problem_options("10000:10005")
@click.option("--budget", type=int, default=100, show_default=True, help="Evaluations for each dimension, as in plans.")
@click.option("--seed", type=int, default=0, show_default=True)
@click.option("--set", "texts", multiple=True, metavar="SETTING=VALUE", help="Of the optimiser; repeatable.")
@click.option("--infeasible", default="repair", show_default=True, help="repair, reject or penalise.")
@click.option("--name", default=NAME, show_default=True, help="Of the suite.")
@click.option("--out", metavar="DIR", help="New folder for IOHprofiler's files.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON array and nothing else on stdout.")
def suite_run(
    optimiser: str,
    functions: tuple[int, ...],
    dimensions: tuple[int, ...],
    instances: tuple[int | None, int | None],
    budget: int,
    seed: int,
    texts: tuple[str, ...],
    infeasible: Any,
    name: str,
    out: str | None,
    as_json: bool,
) -> None:
    """Run OPTIMISER on problems of the numbered benchmark, and print what it reaches."""
    from posefit import settings
    from posefit.fitting.check import whole
    from posefit.registry import registry
    from posefit.suites.problem import Suite
    from posefit.suites.running import run_on
    from posefit.suites.tally import score_lines, suite_scores

    with results_alone():
        whole("budget", budget, 1)
        whole("seed", seed, 0)
        _check_free(out)
        problems = Suite(
            name,
            functions=functions or None,
            dimensions=dimensions or (9,),
            instances=_numbers(instances),
            infeasible=infeasible,
        )
        for one in problems.passed_over:
            listed = ", ".join(map(str, one.dimensions))
            say(f"function {one.number} is left out: it has dimensions {listed}")
        chosen = settings.parse_texts(optimiser, registry().optimiser(optimiser), texts)
        asked = (
            run_on(problem, optimiser, chosen, evaluations=budget * problem.dimension, seed=seed)
            for problem in problems
        )
        runs = list(progress(asked, len(problems), "run"))
        scores = suite_scores(runs)
        if out is not None:
            write_runs(runs, out)
            say(f"written to {out}: IOHprofiler's files")
    for line in [json_line([one.as_dict() for one in scores])] if as_json else score_lines(scores):
        click.echo(line)


@suite.command("table")
@click.argument("ledger", metavar="DIR")
@click.option("--iohprofiler", metavar="DIR", help="New folder for IOHprofiler's files.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON array and nothing else on stdout.")
def suite_table(ledger: str, iohprofiler: str | None, as_json: bool) -> None:
    """Print the scores of a sweep of single searches in DIR, by dimension, function and method."""
    from posefit.suites.tally import score_lines, suite_scores
    from posefit.sweep.ledger import Ledger
    from posefit.sweep.table import search_runs

    _check_free(iohprofiler)
    results = Ledger(ledger, say)
    runs = list(search_runs(results))
    scores = suite_scores(runs)
    if iohprofiler is not None:
        write_runs(runs, iohprofiler)
        say(f"written to {iohprofiler}: IOHprofiler's files")
    if failed := len(results.quarantined()):
        say(f"{failed} {'cell' if failed == 1 else 'cells'} failed, left out of all figures")
    for line in [json_line([one.as_dict() for one in scores])] if as_json else score_lines(scores):
        click.echo(line)


@suite.command("audit")
@_problem_options("10000:10003")
@click.option("--method", "methods", multiple=True, help="Searches with the usual budget; repeatable.")
@click.option("--times", type=int, default=100, show_default=True, help="How much longer CMA-ES searches; 0 for not.")
@click.option("--write", metavar="FILE", help="New file of the best costs, as known.json of the suite.")
@click.pass_context
def suite_audit(
    context: click.Context,
    functions: tuple[int, ...],
    dimensions: tuple[int, ...],
    instances: tuple[int | None, int | None],
    methods: tuple[str, ...],
    times: int,
    write: str | None,
) -> None:
    """Search problems with each method, and check what is reported; exit status 1 where something is wrong."""
    import json

    from posefit.files import new_file
    from posefit.fitting.check import whole
    from posefit.suites.audit import METHODS, audit_lines, audited, known_json
    from posefit.suites.problem import Suite

    with results_alone():
        whole("times", times, 0)
        _check_free(write)
        problems = Suite(functions=functions or None, dimensions=dimensions or (9,), instances=_numbers(instances))
        searching = methods or METHODS
        asked = audited(problems, searching, times=times)
        rows = list(progress(asked, len(problems), "problem"))
        if write is not None:
            with new_file(write) as building:
                building.write_text(json.dumps(known_json(rows, searching, times), indent=1) + "\n", encoding="utf-8")
    for line in audit_lines(rows):
        click.echo(line)
    context.exit(1 if any(row.faults for row in rows) else 0)


def _check_free(path: str | None) -> None:
    """Return nothing. Raises ValueError where a file or folder exists already, or has no place."""
    from posefit.files import check_new, check_place

    if path is not None:
        check_new(path)
        check_place(path)


def _numbers(instances: tuple[int | None, int | None]) -> range:
    """Return the instances of a range A:B. Raises ValueError where there are none."""
    from posefit.suites.functions import INSTANCES

    first, last = instances[0] or 0, INSTANCES.stop if instances[1] is None else instances[1]
    if not 0 <= first < last <= INSTANCES.stop:
        raise InputError(f"--instances must be A:B with 0 <= A < B <= {INSTANCES.stop}, got {first}:{last}")
    return range(first, last)


def write_runs(runs: "list[SuiteRun]", out: str) -> None:
    """Write runs to a new folder, as IOHprofiler has them.

    The settings of a run include its way with infeasible proposals and, where a dimension has several budgets, the
    budget. Both have names of several words, which no optimiser's setting has.
    """
    from posefit.report.export import LoggedRun, write_iohprofiler
    from posefit.suites.functions import suite_function
    from posefit.suites.tally import budgets_differ

    several = budgets_differ(runs)

    def logged(run: "SuiteRun") -> LoggedRun:
        budget = {"evaluations for each dimension": run.budget / run.dimension} if several else {}
        settings = {**run.settings, "infeasible proposals": run.infeasible, **budget}
        name = f"f{run.function} {suite_function(run.function).name}"
        return LoggedRun(run.method, settings, name, run.dimension, run.instance, run.seed, run.evaluations, run.costs)

    write_iohprofiler(map(logged, runs), out)
