"""Contests of runs that took no work."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from posefit.report.contest import Contest, Runs, contest_of
from posefit.report.leaderboard import Standings, leaderboard
from posefit.report.reading import runs_of
from posefit.report.summary import leader_sentences
from posefit.sweep.ledger import Ledger
from tests.report.browser import ledger, result
from tests.sweep.fake import cells

FIRST = cells(1)[0]
Errors = dict[tuple[str, int, int], float]  # of method, instance and seed


def runs_in(path: Path, *methods: str, latest: bool = False) -> Runs:
    """Return the runs of a ledger."""
    with Ledger(path) as opened:
        return runs_of(opened, methods, latest=latest)


def contest_in(path: Path) -> Contest:
    """Return the contest of a ledger."""
    contest = contest_of(runs_in(path))
    assert contest is not None
    return contest


def contest_of_results(path: Path, results: Iterable[dict[str, Any]]) -> Contest:
    return contest_in(ledger(path / "results", results))


def results_of(errors: Errors) -> list[dict[str, Any]]:
    return [
        result(replace(FIRST, method=m, instance=i, seed=s), error)
        for (m, i, s), error in errors.items()
    ]


def contest_of_errors(path: Path, errors: Errors) -> Contest:
    return contest_of_results(path, results_of(errors))


def full(methods: dict[str, float], instances: int = 2, seeds: int = 2) -> Errors:
    """Return the errors of methods that are a little worse on later instances and seeds."""
    return {
        (name, i, s): error + 0.1 * i + 0.01 * s
        for name, error in methods.items()
        for i in range(instances)
        for s in range(seeds)
    }


def three_methods() -> Errors:
    """Return errors of which b's are about 1 more than a's in each of 12 blocks, and c's differ by chance alone."""
    errors = full({"a": 1.0, "b": 2.0}, instances=6)
    for k, (i, seed) in enumerate((i, seed) for i in range(6) for seed in range(2)):
        errors["b", i, seed] += 0.02 * (k % 3)
        errors["c", i, seed] = errors["a", i, seed] + 0.001 * (-1) ** i
    return errors


def sentences(contest: Contest) -> list[str]:
    """Return the sentences of a report."""
    return leader_sentences(standings(contest))


def standings(contest: Contest) -> Standings:
    """Return its leaderboard and its baselines."""
    return Standings(
        contest, leaderboard(contest), contest.runs.kind.baselines(contest)
    )


def board_of(contest: Contest) -> list[dict[str, Any]]:
    """Return the rows of its leaderboard by name."""
    return [row.as_dict() for row in leaderboard(contest)]


def baselines(contest: Contest) -> list[dict[str, Any]]:
    """Return the rows of its baselines."""
    return [row.as_dict() for row in contest.runs.kind.baselines(contest)]
