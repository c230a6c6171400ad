"""What runs on a suite come to, by method, function and dimension: shares of targets, running times, costs.

Targets are an instance's own, from 32 to 0.25 above its best known cost. Hansen et al., COCO: a platform for comparing
continuous optimizers in a black-box setting, 2021.
"""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.statistics.profiles import attained, expected_running_time, hits
from posefit.suites.functions import suite_function
from posefit.suites.problem import TARGETS
from posefit.suites.running import SuiteRun

ALL = 0  # the number that stands for all functions together
SHOWN = (16.0, 4.0, 1.0, 0.25)  # of the targets above the best known, those with an expected running time
POINTS = (1, 3, 10, 30, 100, 300, 1000)  # evaluations for each dimension at which shares are told


@dataclass(frozen=True)
class SuiteScore:
    """What runs of one method on one function in one dimension come to."""

    method: str
    function: int
    name: str
    dimension: int
    runs: int
    above: float  # median of the best costs above the best known
    reached: float  # share of runs and targets, at the end
    shares: dict[int, float]  # the same after so many evaluations for each dimension, as far as budgets go
    running_times: dict[float, float | None]  # expected evaluations to so much above the best known; None for never

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON holds it."""
        return asdict(self)


def suite_scores(runs: Iterable[SuiteRun]) -> list[SuiteScore]:
    """Return the scores of runs, by dimension, function and method, the best method first.

    In a dimension with several functions those of all together come first, as function 0. Methods with other settings
    are other methods. Raises ValueError where there is no run.
    """
    groups: dict[tuple[int, int, str], list[SuiteRun]] = {}
    for run in runs:
        for function in (run.function, ALL):
            groups.setdefault((run.dimension, function, method_name(run)), []).append(run)
    if not groups:
        raise ValueError("runs must be at least one, got none")
    several = {dimension for dimension, _, _ in groups if len({f for d, f, _ in groups if d == dimension}) > 2}
    found = [
        _score(method, function, dimension, mine)
        for (dimension, function, method), mine in groups.items()
        if function != ALL or dimension in several
    ]
    return sorted(found, key=lambda one: (one.dimension, one.function, -one.reached, one.above, one.method))


def method_name(run: SuiteRun) -> str:
    """Return a run's method with what was set of it."""
    told = ", ".join(f"{name}={value}" for name, value in sorted(run.settings.items()))
    return f"{run.method} ({told})" if told else run.method


def _score(method: str, function: int, dimension: int, runs: Sequence[SuiteRun]) -> SuiteScore:
    reached = np.array([hits((run.evaluations, run.costs), run.targets) for run in runs])
    spent = np.array([run.evaluations[-1] for run in runs])
    times = expected_running_time(reached, spent)
    points = [point for point in POINTS if point * dimension <= min(run.budget for run in runs)]
    shares = attained(reached, [*(point * dimension for point in points), float(spent.max())])
    return SuiteScore(
        method,
        function,
        "all functions" if function == ALL else suite_function(function).name,
        dimension,
        len(runs),
        float(np.median([run.cost - run.best_known for run in runs])),
        float(shares[-1]),
        dict(zip(points, shares[:-1].tolist(), strict=True)),
        {above: _finite(times[np.flatnonzero(above == TARGETS)[0]]) for above in SHOWN},
    )


def _finite(value: Array | float) -> float | None:
    return float(value) if np.isfinite(value) else None


def score_lines(scores: Sequence[SuiteScore]) -> list[str]:
    """Return the lines of two tables of scores, for a terminal: where runs end, and how soon they reach targets."""
    heads = [f"ERT +{above:g}" for above in SHOWN]
    wide = max(24, *(len(one.method) for one in scores)) if scores else 24
    lines = [f"{'d':>3} {'function':22} {'method':{wide}} {'runs':>5} {'above':>7} {'targets':>8}" + _cells(heads)]
    for one in scores:
        times = ["-" if one.running_times[above] is None else f"{one.running_times[above]:.0f}" for above in SHOWN]
        figures = f"{one.runs:>5} {one.above:>7.2f} {one.reached:>8.1%}"
        lines.append(f"{_start(one, wide)} {figures}{_cells(times)}")
    points = sorted({point for one in scores for point in one.shares})
    lines += ["", f"share of targets reached after d x{'':{wide - 1}}" + _cells([str(point) for point in points])]
    for one in scores:
        shares = [f"{one.shares[point]:.1%}" if point in one.shares else "" for point in points]
        lines.append(f"{_start(one, wide)}{_cells(shares)}".rstrip())
    return lines


def _start(score: SuiteScore, wide: int) -> str:
    """Return the columns that both tables begin with."""
    label = score.name if score.function == ALL else f"{score.function} {score.name}"
    return f"{score.dimension:>3} {label:22} {score.method:{wide}}"


def _cells(texts: Sequence[str]) -> str:
    return "".join(f" {text:>10}" for text in texts)
