"""Ledgers of single searches that took no work."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from posefit.sweep.cell import SearchCell
from tests.report.browser import ledger

BUDGET = 100  # evaluations for each dimension


def cell(
    method: str,
    function: int = 1,
    dimension: int = 9,
    instance: int = 10_000,
    **more: Any,
) -> SearchCell:
    suite = "posefit-2026.3"
    return SearchCell(
        method,
        suite,
        function,
        dimension,
        instance,
        more.pop("budget", BUDGET) * dimension,
        **more,
    )


def search_result(cell: SearchCell, targets: int) -> dict[str, Any]:
    """Return the result of a search that reaches so many of 29 targets above 0: one each ten evaluations."""
    costs = [40.0, *(2.0 ** (5.0 - k / 4.0) for k in range(targets))]
    used = [1, *(10 * (k + 1) for k in range(targets))]
    if used[-1] < cell.evaluations:
        used = [*used, cell.evaluations]
        costs = [*costs, costs[-1]]
    row = {
        **{
            "key": cell.key,
            "spec": cell.spec,
            "status": "done",
            "cost": costs[-1],
            "truth_cost": 0.0,
        },
        **{
            "evaluations_used": cell.evaluations,
            "dimensions": cell.dimension,
            "seconds": 0.1,
            "warnings": [],
        },
        "trace": {"evaluations": used, "cost": costs},
    }
    return row


def searched(
    path: Path,
    methods: Mapping[str, int],
    problems: Iterable[tuple[int, int, int]],
    lost: Iterable[tuple[SearchCell, list[str]]] = (),
) -> Path:
    """Write a ledger in which each method reaches so many targets, up to two more on some instances."""
    made = [
        search_result(cell(method, *problem), targets + (problem[0] + problem[2]) % 3)
        for method, targets in methods.items()
        for problem in problems
    ]
    return ledger(path, made, lost)


def problems(
    functions: Iterable[int], dimensions: Iterable[int], instances: int
) -> list[tuple[int, int, int]]:
    return [
        (f, d, 10_000 + i)
        for f in functions
        for d in dimensions
        for i in range(instances)
    ]
