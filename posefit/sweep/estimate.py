"""How long a plan will take, from a few small cells of each kind that are really run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from posefit.sweep.cell import Cell
from posefit.sweep.engines.engine import Engine

TRIAL_SECONDS = 120.0  # that a trial may take at most, whatever a cell may
POLL_SECONDS = 0.2


@dataclass
class KindTotal:
    """Cells of one kind as numbers: there may be a million of them."""

    largest: Cell  # the first of those with the most evaluations: of a smaller one the time would be inexact
    count: int = 0
    evaluations: int = 0  # of all frames

    def add(self, cell: Cell) -> None:
        """Count a cell."""
        self.count += 1
        self.evaluations += cell.total_evaluations
        self.largest = max(self.largest, cell, key=lambda known: known.total_evaluations)


Workload = dict[tuple[object, ...], KindTotal]  # the cells of a plan that are to run, by kind


@dataclass(frozen=True)
class Estimate:
    """About how many seconds cells take; and of kinds that could not be tried, a cell and the reason."""

    seconds: float
    untried: Mapping[str, str]


def estimate_of(workload: Workload, engine: Engine, workers: int) -> Estimate:
    """Return about how long cells take on so many workers.

    For each kind of cell two trials are run, after a first pair that compiles what is not compiled yet: they differ by
    the time of their evaluations. A kind that fails, as it would in the sweep, counts for nothing and is named.
    """
    seconds, untried = 0.0, {}
    warmed = [_run(total.largest.trials(), engine) for total in workload.values()]
    for total, warm in zip(workload.values(), warmed, strict=True):
        short, long = total.largest.trials()
        times = warm if isinstance(warm, str) else _run((short, long), engine)
        if isinstance(times, str):
            untried[str(total.largest)] = times
            continue
        more = long.total_evaluations - short.total_evaluations
        per_evaluation = max(times[1] - times[0], 0.0) / more if more else 0.0
        start_up = max(times[0] - per_evaluation * short.total_evaluations, 0.0)
        seconds += total.count * start_up + per_evaluation * total.evaluations
    return Estimate(seconds / workers, untried)


def _run(cells: Sequence[Cell], engine: Engine) -> list[float] | str:
    times = []
    for cell in cells:
        engine.submit(cell)
        while not (ended := engine.wait(POLL_SECONDS)):
            pass
        if ended[0].result is None:
            return ended[0].reason or "what ran it was lost"
        times.append(float(ended[0].result.row["seconds"]))
    return times
