"""Single searches in a report: their figures, names, intervals and baseline, and what the page has of them alone."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.evaluation.measures import Measure
from posefit.reading import counted
from posefit.report.charts import Chart, Line
from posefit.report.columns import Column, Score, listed, mean, median
from posefit.report.kind import Contest, Kind, Place, Runs
from posefit.statistics.means import mean_interval, mean_intervals
from posefit.statistics.profiles import attained, hits
from posefit.suites.functions import suite_function
from posefit.suites.problem import TARGETS
from posefit.suites.running import ALL, SHOWN, suite_scores
from posefit.sweep.table import search_run

RANDOM = "random"  # the method that is the baseline
POINTS = 61  # of a curve

_COLUMNS = (
    Column("reached", Measure("reached", "targets", "%", 1, "Share of all runs and targets that were reached"),
           higher_is_better=True, average=mean),
    Column("above", Measure("above", "above", "", 2, "Median of the best costs above the true pose's"), average=median),
    Column("error", Measure("error", "targets missed", "%", 1, "What is left of 100 %"), in_tables=False, average=mean),
)  # fmt: skip


SCORE = Score(
    name="reached",
    axis="share of targets reached",
    sentence="{} of all targets reached",
    unit=" %",
    points=" points",
    digits=1,
    down=True,
    paired="instances",
    caption="Share of all runs and targets that a method reached, with the 95 % interval that other instances "
    "would give, if a function has several; a dashed line is random search.",
    leaderboard="Shares of targets are means over all runs and targets. Above is the median of the best costs "
    "above the true pose's. ",
)


def _read(row: Mapping[str, Any], _: dict[bytes, Any]) -> tuple[Array, tuple[Any, ...]]:
    run = search_run(row)
    evaluations = hits((run.evaluations, run.costs), run.targets)
    reached = 100.0 * float(np.isfinite(evaluations).mean())
    return np.array([reached, run.cost - run.truth_cost, 100.0 - reached]), (
        run,
        evaluations,
    )


def _rank(place: Place) -> tuple[Any, ...]:
    return place["function"], place["dimension"], place["instance"], place["suite"]


def _place_name(place: Place) -> str:
    return (
        f"f{place['function']} in {place['dimension']}D, instance {place['instance']}"
    )


def _tested_errors(contest: Contest) -> Array:
    """Return the errors (methods, blocks, 1) that tests compare.

    A block is an instance of a function, the same pose in every dimension: the mean over seeds and dimensions.
    """
    poses = [
        (place["function"], place["instance"], place["suite"])
        for place in contest.places()
    ]
    index = {pose: k for k, pose in enumerate(dict.fromkeys(poses))}
    block = np.array([index[pose] for pose in poses])
    sums = np.array(
        [np.bincount(block, row) for row in contest.of("error").mean(axis=2)]
    )
    return np.asarray((sums / np.bincount(block))[:, :, None])


def _board(contest: Contest) -> dict[int, dict[str, Any]]:
    """Return each method's mean share of targets, with the interval of other instances."""
    strata, clusters = (
        [place[name] for place in contest.places()] for name in ("function", "instance")
    )
    variants = contest.runs.variants
    board: dict[int, dict[str, Any]] = {
        m: {"low": None, "high": None, "is_random": v["method"] == RANDOM}
        for m, v in enumerate(variants)
    }
    for m, shares in zip(
        contest.methods, contest.of("reached").mean(axis=2), strict=True
    ):
        share = mean_interval(shares, strata, clusters)
        board[m] |= {
            "reached": share.value,
            "low": max(share.low, 0.0),
            "high": min(share.high, 100.0),
        }
    return board


def _baseline_rows(contest: Contest) -> list[dict[str, Any]]:
    """Return a row for random search, the best of its variants that take part; none if there is none."""
    random = [
        k
        for k, m in enumerate(contest.methods)
        if contest.runs.variants[m]["method"] == RANDOM
    ]
    shares = [
        float(shares_of_runs.mean()) for shares_of_runs in contest.of("reached")[random]
    ]
    return [{"baseline": RANDOM, "reached": max(shares)}] if shares else []


def _place_words(contest: Contest) -> str:
    places = contest.places()
    functions, dimensions = (
        sorted({place[name] for place in places}) for name in ("function", "dimension")
    )
    instances = counted(
        len({(place["function"], place["instance"]) for place in places}), "instance"
    )
    noun = "function" if len(functions) == 1 else "functions"
    numbers = (
        f"{listed(functions, len(functions))} in {listed(dimensions, len(dimensions))}"
    )
    return f"{noun} {numbers} dimensions, {instances} in all"


def _baseline_sentences(first: Mapping[str, Any], rows: Sequence[Any]) -> list[str]:
    if first["is_random"]:
        return ["That is random search: no method does better."]
    return [f"Random search reached {SCORE.text(row['reached'])}." for row in rows]


def _facts(runs: Runs) -> dict[str, Any]:
    return {
        "instances": f"{len(runs.instances):,}",
        "suite": runs.values("suite"),
        "functions": [_function(number) for number in runs.values("function")],
        "dimensions": runs.values("dimension"),
        "seeds": f"{len(runs.seeds):,}",
        "evaluations for each dimension": [
            f"{budget:g}" for budget in runs.values("budget")
        ],
        "infeasible proposals": runs.values("infeasible"),
        "targets of a problem": f"{len(TARGETS)} costs, {TARGETS[0]:g} to {TARGETS[-1]:g} above the true pose's",
    }


def search_charts(contest: Contest) -> list[Chart]:
    """Return the shares of targets reached over evaluations, of all functions and of each, with their intervals.

    Intervals are those that other instances would give.
    """
    functions, dimensions, instances = (
        np.array([place[name] for place in contest.places()])
        for name in ("function", "dimension", "instance")
    )
    runs = [contest.runs.data["runs"][k] for k in map(int, contest.rows.ravel())]
    most = max(float(run.evaluations[-1]) / run.dimension for run in runs)
    evaluations = np.unique(np.geomspace(1.0, max(most, 1.0), POINTS))
    used = (
        contest.runs.data["hits"][contest.rows]
        / dimensions.astype(np.float64)[None, :, None, None]
    )
    numbers = np.unique(functions).tolist()
    parts = {"All functions": functions > 0}
    parts |= {
        _function(number): functions == number for number in numbers if len(numbers) > 1
    }
    charts: list[Chart] = []
    for title, part in parts.items():
        lines = []
        for hits_of_method in used[:, part]:
            shares = np.array(
                [
                    attained(hits_of_instance, evaluations)
                    for hits_of_instance in hits_of_method
                ]
            ).T
            interval = mean_intervals(shares, functions[part], instances[part])
            lines.append(
                Line(evaluations, interval.values, interval.low, interval.high)
            )
        x = "evaluations for each dimension"
        y = "share of targets reached"
        chart = Chart(
            name=f"chart-{len(charts)}",
            title=title,
            x_label=x,
            y_label=y,
            lines=lines,
            log=True,
            stepped=True,
        )
        charts.append(chart)
    end = min(
        1.0,
        1.1
        * max(
            0.05,
            *(float(line.y[-1]) for chart in charts for line in chart.lines if line),
        ),
    )
    return [replace(chart, most=end) for chart in charts]


def running_times(contest: Contest) -> list[dict[str, Any]]:
    """Return the scores of each method's shared runs, a row for each dimension and function: see `suite_scores`.

    There are none of all functions together, whose mean would be that of the hardest.
    """
    runs = contest.runs.data["runs"]
    return [
        {
            "method": method,
            "function": score.function,
            "name": score.name,
            "dimension": score.dimension,
            "runs": score.runs,
            "reached": 100.0 * score.reached,
            "above": score.above,
            "times": [score.running_times[above] for above in SHOWN],
        }
        for method in contest.methods
        for score in suite_scores(runs[k] for k in contest.rows_of(method).tolist())
        if score.function != ALL
    ]


def _function(number: int) -> str:
    return f"{number} {suite_function(number).name}"


SEARCHES = Kind(
    name="search",
    noun="searches",
    title="Report of single searches",
    columns={column.name: column for column in _COLUMNS},
    named=("function", "dimension", "instance"),
    data=("runs", "hits"),  # `SuiteRun`; evaluations (targets,), inf for never
    baselines={RANDOM: "random search"},
    score=SCORE,
    read=_read,
    rank=_rank,
    place_name=_place_name,
    tested_errors=_tested_errors,
    board=_board,
    baseline_rows=_baseline_rows,
    place_words=_place_words,
    baseline_sentences=_baseline_sentences,
    facts=_facts,
)
