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
from posefit.searching.twins import twins
from posefit.uncertainty.landscape import Landscape
from posefit.uncertainty.modes import Posterior
from posefit.uncertainty.searches import Searched, weighed

SEARCHES = 8  # ours
SHARE = 8.0  # ours: evaluations of all else, over those of the first search
OTHERS = 0.25  # ours: the share of those that other searches have
LEAST = 200  # ours: evaluations of another search, without which it is better not begun
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
    the problem's space says; the others start anywhere in it. All else has `share` times as many: a quarter is the
    other searches', as far as each has 200, and with the rest what was found is weighed. Raises ValueError where a
    number makes no sense.
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
    spared = int(OTHERS * evaluations)
    others = elsewhere(problem, make, spared, rng, min(searches, spared // LEAST))
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
    return gathered([(np.array(one), costs) for one, costs in populations(optimiser, problem.evaluate, evaluations)])


def gathered(found: list[Searched]) -> Searched:
    """Return the populations of a search as one."""
    return np.concatenate([one for one, _ in found]), np.concatenate([costs for _, costs in found])


def told(problem: PoseProblem, proposals: Array, weights: Array) -> Posterior:
    """Return weighted proposals (n, d) as poses."""
    return Posterior(*problem.decode(proposals), weights)
