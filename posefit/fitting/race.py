"""A race of modes: short searches from several starts, then long ones from the best.

The weights decide which starts get a short search. The costs that these reach decide
which starts get the rest of the budget. Each search is a problem of its own; together
they use the budget of one.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from posefit.fitting.box import Start
from posefit.fitting.problem import Problem

# All constants are ours. Starts with less than this share of the likeliest start's
# weight are not searched.
MIN_WEIGHT = 0.05
SHORT_SHARE = 0.5  # share of the budget for the short searches
MIN_SHORT = 40  # evaluations of a short search, at least
FINALISTS = 2  # starts that are searched longer
# A finalist starts around its best proposal with this share of its first spread.
FINAL_SPREAD = 0.5

# Searches from a start within a number of evaluations.
Search = Callable[[Start, int], Problem]


def race(starts: Sequence[Start], search: Search, budget: int) -> list[list[Problem]]:
    """Return the searches from each start that took part, the cheapest start first.

    Args:
        starts: Where to search, the likeliest first.
        search: Returns the problem of a start, searched within a number of evaluations.
        budget: The evaluations of all searches together.

    Returns:
        The problems of each start: its short search, and the long one of a finalist.
    """
    short_budget = int(SHORT_SHARE * budget)
    likely = [each for each in starts if each.weight >= MIN_WEIGHT * starts[0].weight]
    likely = likely[: max(short_budget // MIN_SHORT, 1)]
    if len(likely) == 1:
        return [[search(likely[0], budget)]]
    short = short_budget // len(likely)
    raced = []
    remaining = budget
    for start in likely:
        problem = search(start, short)
        raced.append((start, [problem]))
        # a search may end early, and leave more for the finalists
        remaining -= problem.evaluations
    raced.sort(key=lambda each: each[1][0].best_cost)
    for number in range(FINALISTS):
        start, problems = raced[number]
        share = remaining // (FINALISTS - number)
        again = replace(
            start, mean=problems[0].best, spread=FINAL_SPREAD * start.spread
        )
        problems.append(search(again, share))
        remaining -= problems[1].evaluations
    raced.sort(key=lambda each: least_cost(each[1]))
    return [problems for _, problems in raced]


def least_cost(problems: Sequence[Problem]) -> float:
    """Return the lowest cost of some problems."""
    return float(np.min([problem.best_cost for problem in problems]))


def cheapest(problems: Sequence[Problem]) -> Problem:
    """Return the problem with the lowest cost."""
    return min(problems, key=lambda problem: problem.best_cost)
