"""`posefit suite`."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from posefit.cli.group import Group
from posefit.cli.options import parsed_by
from posefit.cli.output import print_result, progress, results_alone, say
from posefit.errors import InputError
from posefit.tracking.options import text_range

if TYPE_CHECKING:
    from posefit.suites.running import SuiteRun, SuiteScore


@click.group(cls=Group, invoke_without_command=True)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON array.")
@click.pass_context
def suite(context: click.Context, as_json: bool) -> None:
    """List the functions of the numbered benchmark, and their dimensions."""
    if context.invoked_subcommand is not None:
        return
    from posefit.suites.functions import FUNCTIONS, HELD_OUT, SUITE, TRAINING

    lines = [f"{SUITE}: proposals in [-1, 1]^d, costs of 0 to 100"]
    lines += [f"instances {TRAINING[0]} to {TRAINING[-1]} for training, {HELD_OUT[0]} to {HELD_OUT[-1]} held out", ""]
    for one in FUNCTIONS:
        dimensions = ", ".join(map(str, one.dimensions))
        lines.append(f"  {one.number}  {one.name:20} d = {dimensions:14} {one.summary}")
    print_result(lines, [asdict(function) for function in FUNCTIONS], as_json)


@suite.command("run")
@click.argument("optimiser")
@click.option("--function", "functions", type=int, multiple=True, help="Its number; repeatable, by default each.")
@click.option("--dimension", "dimensions", type=int, multiple=True, help="Repeatable, by default 9.")
@click.option(
    "--instances",
    callback=parsed_by(text_range),
    default="10000:10005",
    show_default=True,
    metavar="A:B",
    help="A to B - 1.",
)
@click.option("--budget", type=int, default=100, show_default=True, help="Evaluations for each dimension, as in plans.")
@click.option("--seed", type=int, default=0, show_default=True)
@click.option("--set", "texts", multiple=True, metavar="SETTING=VALUE", help="Of the optimiser; repeatable.")
@click.option("--infeasible", default="repair", show_default=True, help="repair, reject or penalise.")
@click.option("--out", metavar="DIR", help="New folder for IOHprofiler's files.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON array and nothing else on stdout.")
def suite_run(
    optimiser: str,
    *,
    functions: tuple[int, ...],
    dimensions: tuple[int, ...],
    instances: tuple[int | None, int | None],
    budget: int,
    seed: int,
    texts: tuple[str, ...],
    infeasible: Any,
    out: str | None,
    as_json: bool,
) -> None:
    """Run OPTIMISER on problems of the numbered benchmark, and print what it reaches."""
    from posefit import settings
    from posefit.files import check_free
    from posefit.fitting.check import whole
    from posefit.registry import registry
    from posefit.suites.problem import Suite
    from posefit.suites.running import run_on

    with results_alone():
        whole("budget", budget, 1)
        whole("seed", seed, 0)
        check_free(out)
        numbers = _numbers(*instances)
        chosen_functions, chosen_dimensions = functions or None, dimensions or (9,)
        problems = Suite(
            functions=chosen_functions, dimensions=chosen_dimensions, instances=numbers, infeasible=infeasible
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
    _print(runs, out, as_json)


@suite.command("table")
@click.argument("ledger", metavar="DIR")
@click.option("--iohprofiler", metavar="DIR", help="New folder for IOHprofiler's files.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON array and nothing else on stdout.")
def suite_table(ledger: str, iohprofiler: str | None, as_json: bool) -> None:
    """Print the scores of a sweep of single searches in DIR, by dimension, function and method."""
    from posefit.files import check_free
    from posefit.reading import counted
    from posefit.sweep.ledger import Ledger
    from posefit.sweep.table import search_runs

    check_free(iohprofiler)
    results = Ledger(ledger)
    runs = list(search_runs(results.rows(), results.path))
    if failed := len(results.quarantined()):
        say(f"{counted(failed, 'cell')} failed, left out of all figures")
    _print(runs, iohprofiler, as_json)


def _numbers(start: int | None, stop: int | None) -> range:
    """Return the instances of a range A:B. Raises InputError where there are none."""
    from posefit.suites.functions import INSTANCES

    first, last = start or 0, INSTANCES.stop if stop is None else stop
    if not 0 <= first < last <= INSTANCES.stop:
        raise InputError(f"--instances must be A:B with 0 <= A < B <= {INSTANCES.stop}, got {first}:{last}")
    return range(first, last)


def _print(runs: "Sequence[SuiteRun]", out: str | None, as_json: bool) -> None:
    """Print the scores of runs, and write the runs to a new folder, as IOHprofiler has them."""
    from posefit.report.export import write_iohprofiler
    from posefit.suites.running import suite_scores

    scores = suite_scores(runs)
    if out is not None:
        write_iohprofiler(runs, out)
        say(f"written to {out}: IOHprofiler's files")
    print_result(_score_lines(scores), [asdict(score) for score in scores], as_json)


def _score_lines(scores: "Sequence[SuiteScore]") -> list[str]:
    """Return the lines of a table of scores, for a terminal: where runs end, and how soon they reach targets."""
    from posefit.suites.running import ALL, SHOWN, budgets_differ

    budgets, ways = budgets_differ(scores), len({score.infeasible for score in scores}) > 1
    labels = [
        score.method + f", {score.budget / score.dimension:g} x d" * budgets + f", {score.infeasible}" * ways
        for score in scores
    ]
    wide, heads = max(24, *map(len, labels)), [f"ERT +{above:g}" for above in SHOWN]
    lines = [f"{'d':>3} {'function':22} {'method':{wide}} {'runs':>5} {'above':>7} {'targets':>8}" + _cells(heads)]
    for score, label in zip(scores, labels, strict=True):
        function = score.name if score.function == ALL else f"{score.function} {score.name}"
        times = ["-" if time is None else f"{time:.0f}" for time in score.running_times.values()]
        start = f"{score.dimension:>3} {function:22} {label:{wide}}"
        lines.append(f"{start} {score.runs:>5} {score.above:>7.2f} {score.reached:>8.1%}{_cells(times)}".rstrip())
    return lines


def _cells(texts: Sequence[str]) -> str:
    return "".join(f" {text:>10}" for text in texts)
