"""The rows of a ledger of single searches as runs, with the targets of their instances."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from posefit.suites.problem import TARGETS
from posefit.suites.running import SuiteRun
from posefit.sweep.table import is_search

if TYPE_CHECKING:
    from posefit.sweep.ledger import Ledger


def search_runs(ledger: "Ledger") -> Iterator[SuiteRun]:
    """Yield the runs of a ledger. Raises ValueError where it holds none, or something else."""
    count = 0
    for row in ledger.rows():
        if not is_search(row["spec"]):
            raise ValueError(f"{ledger.path}: expected a ledger of single searches, got one of tracks: posefit report")
        count += 1
        yield search_run(row)
    if not count:
        raise ValueError(f"{ledger.path}: expected a ledger with finished rows, got one with none")


def search_run(row: Mapping[str, Any]) -> SuiteRun:
    """Return the run that a row of a single search tells of."""
    spec, trace = row["spec"], row["trace"]
    return SuiteRun(
        spec["method"],
        spec["settings"],
        spec["function"],
        spec["dimension"],
        spec["instance"],
        spec["seed"],
        spec["evaluations"],
        spec["infeasible"],
        row["best_known"],
        row["best_known"] + TARGETS,
        np.array(trace["evaluations"], dtype=np.float64),
        np.array(trace["cost"], dtype=np.float64),
    )
