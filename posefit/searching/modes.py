"""The modes of one problem, with their weights, by several searches of any optimiser."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import Space
from posefit.fitting.check import at_least, positive, whole
from posefit.fitting.optimiser import BudgetError, Optimiser, populations
from posefit.fitting.problem import PoseProblem
from posefit.posterior.landscape import Landscape
from posefit.posterior.modes import Posterior
from posefit.posterior.searches import Searched, weighed
from posefit.searching.twins import twins

SEARCHES = 8  # ours
SHARE = 0.25  # ours: of the evaluations of the first search, what all else has
TEMPERATURE = 2.0  # ours: what silhouette costs, which err together, are divided by
KEPT = 100  # ours: poses of a posterior

MakeOptimiser = Callable[[Space, np.random.Generator], Optimiser]


def modes(
    problem: PoseProblem,
    make: MakeOptimiser,
    *,
    evaluations: int,
    rng: np.random.Generator,
    searches: int = SEARCHES,
    share: float = SHARE,
    temperature: float = TEMPERATURE,
) -> Posterior:
    """Return what silhouettes leave open: 100 poses of equal weight, distributed as exp(-cost / temperature).

    `make(space, rng)` builds the optimiser of each search. The first one has so many `evaluations`, and starts where
    the problem's space says; the others start anywhere in it. They have half of a `share` of as many, and the other
    half weighs what was found; all of it where no other search is made. Raises ValueError where a number makes no sense.
    """
    whole("searches", searches, 1)
    at_least("evaluations", evaluations, 1)
    positive("temperature", temperature)
    positive("share", share)
    first = searched(problem, make(problem.space, rng), evaluations)
    return further(problem, make, first, round(share * evaluations), rng, searches - 1, temperature)[0]


def further(
    problem: PoseProblem,
    make: MakeOptimiser,
    first: Searched,
    evaluations: int,
    rng: np.random.Generator,
    searches: int,
    temperature: float,
) -> tuple[Posterior, int]:
    """Return the posterior of a problem after a first search, by so many more, and how many evaluations it took.

    That is about as many as are given.
    """
    others = elsewhere(problem, make, evaluations // 4, rng, searches) if searches else []
    used = sum(len(costs) for _, costs in others)
    landscape = Landscape(problem.space, problem.evaluate)
    alike = twins(problem, first[0][np.nanargmin(first[1])])
    found = [first, *others, *([(alike, landscape.costs(alike))] if len(alike) else [])]
    left = evaluations - used - landscape.evaluations
    sample = weighed(landscape, found, temperature, rng, evaluations=left)
    return told(problem, *sample.even(KEPT, rng)), used + landscape.evaluations


def elsewhere(
    problem: PoseProblem, make: MakeOptimiser, evaluations: int, rng: np.random.Generator, searches: int
) -> list[Searched]:
    """Return what so many searches evaluated that start anywhere in the problem's space, and share a budget.

    One whose part does not hold a population leaves it to those that come after.
    """
    anywhere, found, left = replace(problem.space, start=None), list[Searched](), evaluations
    for k in range(searches):
        with suppress(BudgetError):
            found.append(searched(problem, make(anywhere, rng), left // (searches - k)))
            left -= len(found[-1][1])
    return found


def searched(problem: PoseProblem, optimiser: Optimiser, evaluations: int) -> Searched:
    """Return all proposals (n, d) that an optimiser had evaluated within a budget, and their costs (n,)."""
    found = [(np.array(one), costs) for one, costs in populations(optimiser, problem.evaluate, evaluations)]
    return gathered(found)


def gathered(found: list[Searched]) -> Searched:
    """Return the populations of a search as one."""
    return np.concatenate([one for one, _ in found]), np.concatenate([costs for _, costs in found])


def told(problem: PoseProblem, proposals: Array, weights: Array) -> Posterior:
    """Return weighted proposals (n, d) as poses."""
    return Posterior(*problem.decode(proposals), weights)
