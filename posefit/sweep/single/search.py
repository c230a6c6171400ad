"""A cell that is one search: everything it depends on, and what it measures."""

import hashlib
import json
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any

from posefit.sweep.cell import CellResult, json_of
from posefit.version import __version__


@dataclass(frozen=True)
class SearchCell:
    """An optimiser on a problem of a suite. `posefit.sweep.single.plan` makes cells that are checked."""

    method: str
    suite: str
    function: int
    dimension: int
    instance: int
    evaluations: int
    settings: Mapping[str, Any] = field(default_factory=dict)  # of the optimiser
    infeasible: str = "repair"
    seed: int = 0
    version: str = __version__  # of posefit, and of plugins that are not its own

    @cached_property
    def spec(self) -> dict[str, Any]:
        """The cell as JSON holds it."""
        spec: dict[str, Any] = json.loads(json.dumps({name: getattr(self, name) for name in SEARCH_FIELDS}))
        return spec

    @cached_property
    def key(self) -> str:
        """The cell's name: the SHA-256 of its spec, version included, as 64 hexadecimal digits."""
        return hashlib.sha256(json_of(self.spec).encode()).hexdigest()

    def __str__(self) -> str:
        return f"{self.method} on f{self.function} in {self.dimension}D, instance {self.instance}, seed {self.seed}"


SEARCH_FIELDS = tuple(one.name for one in fields(SearchCell))


def run_search(cell: SearchCell) -> CellResult:
    """Return what a search measures. Raises ValueError where this posefit is not the one that was planned."""
    from posefit.suites.front import suite
    from posefit.suites.running import run_on

    began = time.perf_counter()
    if (planned := cell.version.partition(",")[0]) != __version__:
        raise ValueError(f"a worker must have posefit {planned}, got {__version__}")
    problem = suite(cell.suite, cell.function, cell.instance, cell.dimension, infeasible=cell.infeasible)  # type: ignore[arg-type]
    found = run_on(problem, cell.method, cell.settings, evaluations=cell.evaluations, seed=cell.seed)
    row = {
        "key": cell.key,
        "spec": cell.spec,
        "status": "done",
        "cost": found.cost,
        "best_known": found.best_known,
        "evaluations_used": problem.evaluations,
        "dimensions": problem.dimension,
        "trace": {"evaluations": [int(used) for used in found.evaluations], "cost": found.costs.tolist()},
        "warnings": [],
        "seconds": time.perf_counter() - began,
    }
    return CellResult(row, b"")
