"""The methods of a ledger of single searches held against each other on the runs that they share.

Problems are drawn: an instance of a function is one pose of one person, the same in every dimension. So intervals say
what other instances would give, and tests pair instances, of which the mean over dimensions and seeds counts.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.report.search.rows import Searches
from posefit.statistics.means import Mean, mean_interval
from posefit.statistics.pairing import Rows, Shared, gaps, most_shared
from posefit.statistics.ranks import LEVEL, compact_letters, wilcoxon

ALL = 100.0  # per cent
RANDOM = "random"  # the method that is the baseline of all others


@dataclass(frozen=True, eq=False)
class Match:
    """The runs that some methods share, paired by problem and seed."""

    searches: Searches
    shared: Shared

    @property
    def methods(self) -> tuple[int, ...]:
        """The methods that take part."""
        return self.shared.methods

    @property
    def problems(self) -> list[tuple[int, int, int, str]]:
        """The problems that are compared: function, dimension, instance and suite."""
        return [self.searches.problems[i] for i in self.shared.instances]

    def reached(self) -> Array:
        """Return the share of targets (methods, problems) reached, in per cent, the mean over seeds."""
        return np.asarray(self.searches.reached[self.shared.rows].mean(axis=2))

    def mine(self, method: int) -> Array:
        """Return which runs (k,) of a method count: those that are shared, or all its own where it takes no part."""
        if method in self.methods:
            return np.asarray(self.shared.rows[self.methods.index(method)].ravel())
        return np.asarray(np.flatnonzero(self.searches.method == method))


def match_of(searches: Searches) -> Match | None:
    """Return the match of as many methods as share enough runs; None where there is no run."""
    found = most_shared(_rows(searches))
    return None if found is None else Match(searches, found)


def left_out(match: Match) -> list[dict[str, Any]]:
    """Return the problems that are compared on no run, by number, and the methods that have none there."""
    found = gaps(_rows(match.searches), match.methods, match.shared.instances)
    return [{"instance": problem, "missing": missing} for problem, missing in found]


def _rows(searches: Searches) -> Rows:
    return Rows(searches.method, searches.problem, searches.seed, ALL - searches.reached)


def search_board(match: Match, tests: dict[str, Any] | None) -> list[dict[str, Any]]:
    """Return a row a method, the highest share of targets first; those that take no part come last, with their own."""
    found: list[dict[str, Any]] = []
    shares = match.reached()
    for m, name in enumerate(match.searches.methods):
        place = match.methods.index(m) if m in match.methods else None
        mine = match.mine(m)
        share = _mean(match, shares[place]) if place is not None else None
        found.append(
            {
                "method": m,
                "name": name,
                "taking_part": share is not None,
                "reached": float(match.searches.reached[mine].mean()) if share is None else share.value,
                "low": None if share is None else max(share.low, 0.0),
                "high": None if share is None else min(share.high, ALL),
                "above": float(np.median([_above(match, int(k)) for k in mine])),
                "runs": len(mine),
                "failed": match.searches.failed[m],
            }
        )
    found.sort(key=lambda row: (not row["taking_part"], -row["reached"], row["above"], row["name"]))
    letters = _letters([row["method"] for row in found if row["taking_part"]], tests)
    return [{**row, "letters": letters.get(row["method"], "")} for row in found]


def random_rows(match: Match, board: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return what random search reached on the same runs, the best where it has several variants; none without it."""
    mine = [row["reached"] for row in board if row["taking_part"] and is_random(match.searches, row["method"])]
    return [{"baseline": RANDOM, "reached": max(mine)}] if mine else []


def is_random(searches: Searches, method: int) -> bool:
    """Return whether a method is random search."""
    return bool(searches.variants[method]["method"] == RANDOM)


def instance_tests(match: Match) -> dict[str, Any] | None:
    """Return Wilcoxon's signed ranks of each two methods over instances, in targets missed; None of too few.

    `pairs` lists first, second, median difference in per cent, p, and p after Holm; a difference below 0 is in favour
    of the first.
    """
    kinds = [(function, instance, suite) for function, _, instance, suite in match.problems]
    place = {kind: k for k, kind in enumerate(dict.fromkeys(kinds))}
    if len(match.methods) < 2 or len(place) < 2:
        return None
    block = np.array([place[kind] for kind in kinds])
    sums = np.array([np.bincount(block, row) for row in match.reached()])
    missed = ALL - sums / np.bincount(block)
    listed = [
        [one.first, one.second, one.difference, one.p_value, one.adjusted] for one in wilcoxon(missed[:, :, None])
    ]
    return {"methods": match.methods, "blocks": len(place), "pairs": listed}


def _mean(match: Match, shares: Array) -> Mean:
    functions = [function for function, *_ in match.problems]
    instances = [instance for _, _, instance, _ in match.problems]
    return mean_interval(shares, functions, instances)


def _above(match: Match, run: int) -> float:
    return match.searches.runs[run].cost - match.searches.runs[run].best_known


def _letters(best_first: list[int], tests: dict[str, Any] | None) -> dict[int, str]:
    if tests is None:
        return {}
    place = {m: k for k, m in enumerate(best_first)}
    numbers = tests["methods"]
    apart = [(place[numbers[a]], place[numbers[b]]) for a, b, _, _, adjusted in tests["pairs"] if adjusted < LEVEL]
    return dict(zip(best_first, compact_letters(len(best_first), apart), strict=True))
