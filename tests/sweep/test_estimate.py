"""How long a plan will take is estimated from a few small cells, whatever its cells are."""

from collections.abc import Sequence
from typing import Any

import pytest

from posefit.sweep.cell import Cell, CellResult
from posefit.sweep.check import cell_of
from posefit.sweep.engines.engine import Ended, Outcome
from posefit.sweep.estimate import KindTotal, Workload, estimate_of
from posefit.sweep.plan import search_cells
from tests.cases import each

SECONDS, EACH = 0.25, 0.001  # of a cell, and of an evaluation of it


class Even:
    """An engine whose cells take so long as they have evaluations, and something more, in no time; pso fails."""

    def __init__(self) -> None:
        self.tried: list[Cell] = []

    def window(self) -> int:
        return 2

    def submit(self, cell: Cell) -> None:
        self.tried.append(cell)

    def wait(self, seconds: float) -> list[Outcome]:
        cell = self.tried[-1]
        if cell.method == "pso":
            return [Ended(cell, None, "it does not work")]
        return [Ended(cell, CellResult({"seconds": SECONDS + EACH * cell.total_evaluations}, b""))]

    def close(self) -> None:
        pass


def tracks() -> Sequence[Cell]:
    spec = {"method": "sapso@pca", "motion": "walk", "evaluations": 100}
    return [cell_of({**spec, "frames": frames}) for frames in (10, 20)]


def searches(**more: Any) -> Sequence[Cell]:
    plan = {"suite": "posefit-2026.3", "methods": ["random"], "functions": [1], "instances": 2, **more}
    return search_cells(plan)


def workload(cells: Sequence[Cell]) -> Workload:
    kinds: Workload = {}
    for cell in cells:
        kinds.setdefault(cell.kind, KindTotal(cell)).add(cell)
    return kinds


@each(
    ("cells", "evaluations"),
    [
        (tracks(), 3_000),
        (searches(), 2 * 900),
        (searches(budgets=[10, 1000], dimensions=[9, 24]), 2 * 1010 * 33),
        (searches(methods=[{"method": "random", "settings": {"population_size": 700}}]), 2 * 900),
    ],
)  # fmt: skip
def test_an_estimate_is_the_time_of_all_cells_where_evaluations_take_the_same(
    cells: Sequence[Cell], evaluations: int
) -> None:
    engine = Even()
    estimate = estimate_of(workload(cells), engine, 2)
    assert estimate.untried == {}
    assert estimate.seconds == pytest.approx((len(cells) * SECONDS + evaluations * EACH) / 2)
    assert sum(cell.total_evaluations for cell in engine.tried) < 10_000
    for cell in engine.tried:
        assert cell.evaluations >= cell.settings.get("population_size", 1)


def test_a_kind_that_fails_is_named_once_and_counts_for_nothing() -> None:
    estimate = estimate_of(workload(searches(methods=["random", "pso"])), Even(), 1)
    assert estimate.untried == {"pso on f1 in 9D, instance 10000, seed 0": "it does not work"}
    assert estimate.seconds == pytest.approx(2 * SECONDS + 2 * 900 * EACH)
