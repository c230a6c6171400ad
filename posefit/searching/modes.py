"""The modes of one problem, with their weights, by several searches of any optimiser."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import Space
from posefit.fitting.check import at_least, positive, whole
from posefit.fitting.optimiser import Optimiser, populations
from posefit.fitting.problem import PoseProblem
from posefit.posterior.landscape import Landscape
from posefit.posterior.modes import Posterior
from posefit.posterior.searches import Searched, weighed

SEARCHES = 8  # ours
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
    temperature: float = TEMPERATURE,
) -> Posterior:
    """Return what silhouettes leave open: 100 poses of equal weight, distributed as exp(-cost / temperature).

    `make(space, rng)` builds the optimiser of each search, which has so many `evaluations`. The first search starts
    where the problem's space says, the others anywhere in it. To weigh what they find takes some thousands of
    evaluations more. Raises ValueError where a number makes no sense.
    """
    whole("searches", searches, 1)
    at_least("evaluations", evaluations, 1)
    positive("temperature", temperature)
    first = searched(problem, make(problem.space, rng), evaluations)
    others = elsewhere(problem, make, evaluations, rng, searches - 1)
    return posterior_of(problem, [first, *others], temperature, rng)[0]


def elsewhere(
    problem: PoseProblem, make: MakeOptimiser, evaluations: int, rng: np.random.Generator, searches: int
) -> list[Searched]:
    """Return what so many searches evaluated that start anywhere in the problem's space."""
    anywhere = replace(problem.space, start=None)
    return [searched(problem, make(anywhere, rng), evaluations) for _ in range(searches)]


def searched(problem: PoseProblem, optimiser: Optimiser, evaluations: int) -> Searched:
    """Return all proposals (n, d) that an optimiser had evaluated within a budget, and their costs (n,)."""
    found = [(np.array(one), costs) for one, costs in populations(optimiser, problem.evaluate, evaluations)]
    return gathered(found)


def gathered(found: list[Searched]) -> Searched:
    """Return the populations of a search as one."""
    return np.concatenate([one for one, _ in found]), np.concatenate([costs for _, costs in found])


def posterior_of(
    problem: PoseProblem, found: list[Searched], temperature: float, rng: np.random.Generator
) -> tuple[Posterior, int]:
    """Return the posterior of a problem in whose space some searches evaluated what was `found`, and what it took."""
    landscape = Landscape(problem.space, problem.evaluate)
    sample = weighed(landscape, found, temperature, rng)
    return told(problem, *sample.even(KEPT, rng)), sample.evaluations


def told(problem: PoseProblem, proposals: Array, weights: Array) -> Posterior:
    """Return weighted proposals (n, d) as poses."""
    return Posterior(*problem.decode(proposals), weights)
