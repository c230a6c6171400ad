"""Single searches in a report: their figures, names, intervals, baseline and page."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.evaluation.measures import Measure
from posefit.reading import counted
from posefit.report.charts import Chart, Line
from posefit.report.columns import Column, Score, listed, median
from posefit.report.contest import Baseline, Contest, Indices, InstanceFields, Row, Runs
from posefit.report.stored import Store
from posefit.statistics.means import mean_interval, mean_intervals
from posefit.statistics.profiles import attained, hits
from posefit.suites.functions import suite_function
from posefit.suites.problem import TARGETS
from posefit.suites.running import ALL, SHOWN, SuiteRun, suite_scores

RANDOM = "random"  # the baseline method
POINTS = 61  # points of a curve


def search_run(row: Mapping[str, Any]) -> SuiteRun:
    """Return the suite run that a ledger's row of a single search describes."""
    spec = row["spec"]
    trace = row["trace"]
    problem = dict(spec)
    for name in ("kind", "name", "evaluations", "version"):
        problem.pop(name, None)
    return SuiteRun(
        **problem,
        budget=spec["evaluations"],
        truth_cost=row["truth_cost"],
        targets=row["truth_cost"] + TARGETS,
        evaluations=np.array(trace["evaluations"], dtype=np.float64),
        costs=np.array(trace["cost"], dtype=np.float64),
    )


def _hits(run: SuiteRun) -> Array:
    """Return the evaluations (targets,) after which a run reached each target.

    They are inf for targets that it never reached.
    """
    return hits((run.evaluations, run.costs), run.targets)


def _figures(run: SuiteRun, hits_of_run: Array) -> dict[str, float]:
    """Return the share of targets that a run reached, and its cost above the truth."""
    reached = 100.0 * float(np.isfinite(hits_of_run).mean())
    return {"reached": reached, "above": run.cost - run.truth_cost}


_REACHED = Measure(
    "reached", "targets", "%", 1, "Share of all runs and targets that were reached"
)
_ABOVE = Measure(
    "above", "above", "", 2, "Median of the best costs above the true pose's"
)
COLUMNS = {
    "reached": Column(_REACHED, higher_is_better=True),
    "above": Column(_ABOVE, average=median),
}
SCORE = Score(
    column=COLUMNS["reached"],
    axis="share of targets reached",
    sentence="reached {} of all targets",
    unit=" %",
    points=" points",
    paired="instances",
    caption="Share of all runs and targets that a method reached, with the 95 % "
    "interval that other instances would give, if a function has several; a dashed "
    "line is random search.",
    leaderboard="Shares of targets are means over all runs and targets. Above is the "
    "median of the best costs above the true pose's. ",
)


class Searches:
    """The kind of runs of single searches, see `posefit.report.contest.Kind`."""

    name = "search"
    noun = "searches"
    title = "Report of single searches"
    columns: Mapping[str, Column] = COLUMNS
    score = SCORE
    # a `SuiteRun`, and the result of `_hits`
    data: Mapping[str, Callable[[], Store]] = MappingProxyType(
        {"runs": list, "hits": list}
    )

    def computed(self, row: Row, /) -> dict[str, float]:
        """Return a row's share of reached targets, and its cost above the truth."""
        run = search_run(row)
        return _figures(run, _hits(run))

    def read(self, row: Row, /) -> tuple[Array, dict[str, Any]]:
        """Return the figures of a row, its run, and its evaluations to each target."""
        run = search_run(row)
        hits_of_run = _hits(run)
        figures = np.array([*_figures(run, hits_of_run).values()])
        return figures, {"runs": run, "hits": hits_of_run}

    def instance_order(self, fields: InstanceFields) -> tuple[Any, ...]:
        """Return the key by which instances are sorted."""
        return (
            fields["function"],
            fields["dimension"],
            fields["instance"],
            fields["suite"],
        )

    def instance_name(self, fields: InstanceFields) -> str:
        """Return an instance's name, such as `f7 in 24D, instance 3`."""
        problem = f"f{fields['function']} in {fields['dimension']}D"
        return f"{problem}, instance {fields['instance']}"

    def facts(self, runs: Runs) -> dict[str, Any]:
        """Return the facts about the runs by their titles."""
        targets = (
            f"{len(TARGETS)} costs, {TARGETS[0]:g} to {TARGETS[-1]:g} "
            "above the true pose's"
        )
        budgets = [f"{budget:g}" for budget in runs.values("budget")]
        return {
            "instances": f"{len(runs.instances):,}",
            "suite": runs.values("suite"),
            "functions": [_function(number) for number in runs.values("function")],
            "dimensions": runs.values("dimension"),
            "seeds": f"{len(runs.seeds):,}",
            "evaluations for each dimension": budgets,
            "infeasible proposals": runs.values("infeasible"),
            "targets of a problem": targets,
        }

    def tested_errors(self, contest: Contest) -> Array:
        """Return the shares of missed targets (methods, blocks, 1), in percent.

        A block is an instance of a function, which has the same pose in every
        dimension. It counts as often as it has runs, because functions may exist in
        different numbers of dimensions: so the mean of the blocks is that of the runs,
        and the difference of two methods is that of their scores.
        """
        fields = [
            contest.instance_field(name) for name in ("function", "instance", "suite")
        ]
        poses = [*zip(*(field.tolist() for field in fields), strict=True)]
        index = {pose: k for k, pose in enumerate(dict.fromkeys(poses))}
        block = np.array([index[pose] for pose in poses])  # (runs,)
        missed = 100.0 - contest.scores  # (methods, runs)
        sums = np.array([np.bincount(block, row) for row in missed])
        weighted = sums / np.bincount(block).mean()  # (methods, blocks)
        return np.asarray(weighted[:, :, None])

    def figures(self, runs: Runs, rows: Indices) -> dict[str, float | None]:
        """Return the averages of some rows."""
        return runs.averages(rows)

    def interval(self, contest: Contest, index: int) -> tuple[float, float]:
        """Return the ends of the interval that other instances would give."""
        functions = contest.instance_field("function")
        instances = contest.instance_field("instance")
        mean = mean_interval(contest.scores[index], functions, instances)
        return max(mean.low, 0.0), min(mean.high, 100.0)

    def baselines(self, contest: Contest) -> list[Baseline]:
        """Return random search, if it takes part: its best variant."""
        shares = []
        for m, shares_of_runs in zip(contest.methods, contest.scores, strict=True):
            if contest.runs.variants[m]["method"] == RANDOM:
                shares.append(float(shares_of_runs.mean()))
        if not shares:
            return []
        return [Baseline(RANDOM, "random search", {SCORE.name: max(shares)})]

    def instance_words(self, contest: Contest) -> str:
        """Return the functions, dimensions and instances of a contest in words."""
        functions = sorted(set(contest.instance_field("function").tolist()))
        dimensions = sorted(set(contest.instance_field("dimension").tolist()))
        problems = set()
        for i in contest.instances:
            fields = contest.runs.instance_fields[i]
            problems.add((fields["function"], fields["instance"]))
        noun = "function" if len(functions) == 1 else "functions"
        words = f"{noun} {listed(functions, len(functions))}"
        words += f" in {listed(dimensions, len(dimensions))} dimensions"
        return f"{words}, {counted(len(problems), 'instance')} in all"

    def baseline_sentences(
        self, contest: Contest, first: int, baselines: Sequence[Baseline]
    ) -> list[str]:
        """Return a sentence about the share of targets that random search reached."""
        if contest.runs.variants[first]["method"] == RANDOM:
            return ["That is random search: no method does better."]
        sentences = []
        for baseline in baselines:
            if (share := baseline.figures[SCORE.name]) is not None:
                sentences.append(f"Random search reached {SCORE.text(share)}.")
        return sentences

    def page(self, _: Runs, contest: Contest | None, /) -> dict[str, Any]:
        """Return the curves, the running times and the list of sections."""
        if contest is None:
            return {"sections": []}
        charts = search_charts(contest)
        return {
            "sections": ["leaderboard", "curves", "times"],
            "charts": [chart.as_dict() for chart in charts],
            "above": SHOWN,
            "times": running_times(contest),
        }


def search_charts(contest: Contest) -> list[Chart]:
    """Return charts of the share of targets reached over evaluations.

    There is one of all functions, and one of each. Intervals show what other instances
    would give.
    """
    functions = contest.instance_field("function")
    instances = contest.instance_field("instance")
    runs = contest.data("runs", contest.blocks)
    most = max(float(run.evaluations[-1]) / run.dimension for run in runs)
    evaluations = np.unique(np.geomspace(1.0, max(most, 1.0), POINTS))
    shares = _shares(contest, evaluations)
    numbers = np.unique(functions).tolist()
    parts = {"All functions": np.ones(len(functions), dtype=bool)}
    if len(numbers) > 1:
        parts |= {_function(number): functions == number for number in numbers}
    charts: list[Chart] = []
    for title, part in parts.items():
        lines = []
        for shares_of_method in shares[:, part]:
            means = mean_intervals(shares_of_method.T, functions[part], instances[part])
            lines.append(Line(evaluations, means.values, means.low, means.high))
        chart = Chart(
            name=f"chart-{len(charts)}",
            title=title,
            x_label="evaluations for each dimension",
            y_label="share of targets reached",
            lines=lines,
            log=True,
        )
        charts.append(chart)
    # one scale for all charts, so that functions can be compared
    ends = [float(line.y[-1]) for chart in charts for line in chart.lines if line]
    end = min(1.0, 1.1 * max(0.05, *ends))
    return [replace(chart, most=end) for chart in charts]


def _shares(contest: Contest, evaluations: Array) -> Array:
    """Return the share of targets that each run reached (methods, blocks, points).

    There is one for each number of evaluations (points,) for each dimension.
    """
    dimensions = contest.instance_field("dimension").astype(np.float64)
    times = np.array(contest.data("hits", contest.blocks))
    times = times.reshape(*contest.blocks.shape, -1)  # (methods, blocks, targets)
    times = times / dimensions[:, None]
    return np.array([[attained(run, evaluations) for run in rows] for rows in times])


def running_times(contest: Contest) -> list[dict[str, Any]]:
    """Return the scores of each method's shared runs.

    They have a row for each dimension and function, as `suite_scores` returns them.
    There is no row for all functions together, because the hardest function would
    decide its mean running time.
    """
    rows = []
    for method in contest.methods:
        runs = contest.data("runs", contest.rows_of(method))
        for score in suite_scores(runs):
            if score.function == ALL:
                continue
            row = {
                "method": method,
                "function": score.function,
                "name": score.name,
                "dimension": score.dimension,
                "runs": score.runs,
                "reached": 100.0 * score.reached,
                "above": score.above,
                "times": [score.running_times[above] for above in SHOWN],
            }
            rows.append(row)
    return rows


def _function(number: int) -> str:
    return f"{number} {suite_function(number).name}"


SEARCHES = Searches()
