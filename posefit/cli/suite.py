"""`posefit suite`."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from posefit.cli.group import Group
from posefit.cli.options import parsed_by
from posefit.cli.output import print_result, progress, results_alone, say
from posefit.errors import InputError
from posefit.footage.options import text_range

if TYPE_CHECKING:
    from posefit.suites.running import SuiteRun, SuiteScore


@click.group(cls=Group, invoke_without_command=True)
@click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="Print the suite as JSON, in the form of IOHexperimenter's registry.",
)
@click.pass_context
def suite(context: click.Context, as_json: bool) -> None:
    """List the functions of the numbered benchmark and their dimensions."""
    if context.invoked_subcommand is not None:
        return
    from posefit.motion.instances import HELD_OUT, TRAINING
    from posefit.suites.functions import FUNCTIONS, SUITE
    from posefit.suites.registry import suite_registry

    training = f"{TRAINING[0]} to {TRAINING[-1]} for training"
    held_out = f"{HELD_OUT[0]} to {HELD_OUT[-1]} held out"
    lines = [
        f"{SUITE}: proposals in [-1, 1]^d, costs of 0 to 100",
        f"instances {training}, {held_out}",
        "",
    ]
    for function in FUNCTIONS:
        dimensions = f"d = {listed(function.dimensions):14}"
        name = f"{function.number}  {function.name:20}"
        lines.append(f"  {name} {dimensions} {function.summary}")
    print_result(lines, suite_registry(), as_json)


@suite.command("run")
@click.argument("optimiser")
@click.option(
    "--function",
    "functions",
    type=int,
    multiple=True,
    help="Number of a function; repeatable, by default all.",
)
@click.option(
    "--dimension",
    "dimensions",
    type=int,
    multiple=True,
    help="Dimension of the problems; repeatable, default 9.",
)
@click.option(
    "--instances",
    callback=parsed_by(text_range),
    default="10000:10005",
    show_default=True,
    metavar="A:B",
    help="Numbers of the instances, A to B - 1.",
)
@click.option(
    "--budget",
    type=int,
    default=100,
    show_default=True,
    help="Evaluations per dimension, as in plans.",
)
@click.option(
    "--seed", type=int, default=0, show_default=True, help="Seed of the optimiser."
)
@click.option(
    "--set",
    "texts",
    multiple=True,
    metavar="SETTING=VALUE",
    help="Setting of the optimiser; repeatable.",
)
@click.option(
    "--infeasible",
    default="repair",
    show_default=True,
    help="What happens to infeasible proposals: repair, reject or penalise.",
)
@click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="Print only one JSON array on stdout.",
)
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
    as_json: bool,
) -> None:
    """Run OPTIMISER on problems of the numbered benchmark, and print the results."""
    from posefit import settings
    from posefit.fitting.check import whole
    from posefit.registry import registry
    from posefit.suites.problem import Suite
    from posefit.suites.running import run_on, suite_scores

    with results_alone():
        whole("budget", budget, 1)
        whole("seed", seed, 0)
        numbers = _numbers(*instances)
        chosen_functions = functions or None
        chosen_dimensions = dimensions or (9,)
        problems = Suite(
            functions=chosen_functions,
            dimensions=chosen_dimensions,
            instances=numbers,
            infeasible=infeasible,
        )
        # a function without the dimension is not an error, because others have it
        for function in problems.passed_over:
            say(
                f"function {function.number} is left out: "
                f"it has dimensions {listed(function.dimensions)}"
            )
        chosen = settings.parse_texts(optimiser, registry().optimiser(optimiser), texts)

        def asked() -> "Iterator[SuiteRun]":
            for problem in problems:
                yield run_on(
                    problem,
                    optimiser,
                    chosen,
                    evaluations=budget * problem.dimension,
                    seed=seed,
                )

        runs = list(progress(asked(), len(problems), "run"))
    scores = suite_scores(runs)
    print_result(_score_lines(scores), [asdict(score) for score in scores], as_json)


def listed(dimensions: Sequence[int]) -> str:
    """Return dimensions separated by commas."""
    return ", ".join(map(str, dimensions))


def _numbers(start: int | None, stop: int | None) -> range:
    """Return the instances of a range A:B.

    Raises:
        InputError: There are none.
    """
    from posefit.motion.instances import INSTANCES

    first = start or 0
    last = INSTANCES.stop if stop is None else stop
    if not 0 <= first < last <= INSTANCES.stop:
        raise InputError(
            f"--instances must be A:B with 0 <= A < B <= {INSTANCES.stop}, "
            f"got {first}:{last}"
        )
    return range(first, last)


def _score_lines(scores: "Sequence[SuiteScore]") -> list[str]:
    """Return the lines of a table of scores: costs at the end, times to targets."""
    from posefit.suites.running import ALL, SHOWN

    heads = [f"ERT +{above:g}" for above in SHOWN]
    head = f"{'d':>3} {'function':22} {'method':24}"
    head = f"{head} {'runs':>5} {'above':>7} {'targets':>8}"
    lines = [head + _cells(heads)]
    for score in scores:
        function = score.name
        if score.function != ALL:
            function = f"{score.function} {score.name}"
        times = []
        for time in score.running_times.values():
            times.append("-" if time is None else f"{time:.0f}")
        line = f"{score.dimension:>3} {function:22} {score.method:24}"
        line = f"{line} {score.runs:>5} {score.above:>7.2f} {score.reached:>8.1%}"
        lines.append((line + _cells(times)).rstrip())
    return lines


def _cells(texts: Sequence[str]) -> str:
    return "".join(f" {text:>10}" for text in texts)
