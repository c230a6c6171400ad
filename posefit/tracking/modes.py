"""The modes of one problem, by several searches of any optimiser, and a tracker that has them for every frame."""

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import tee

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import Space
from posefit.fitting.check import at_least, positive, whole
from posefit.fitting.optimiser import BudgetError, Minimum, Optimiser, minimum_of, populations
from posefit.fitting.problem import PoseProblem
from posefit.fitting.space import SearchSpace
from posefit.fitting.tracker import Frame, Observation, SynthesisTracker
from posefit.geometry.rotation import wrapped
from posefit.geometry.symmetry import facing, reflected_poses, turned_poses
from posefit.tracking.restarts import independent
from posefit.uncertainty.landscape import Landscape
from posefit.uncertainty.modes import Posterior
from posefit.uncertainty.searches import Searched, boltzmann_weights, weighed
from posefit.uncertainty.smc import systematic_rows

SEARCHES = 8  # ours
SHARE = 8.0  # ours: evaluations of all else, over those of the first search
OTHER_SEARCHES = 0.25  # ours: the share of those that other searches have
MIN_EVALUATIONS = 200  # ours: of another search; with fewer it is not begun
TEMPERATURE = 2.0  # ours: divides silhouette costs, whose errors are correlated
POSTERIOR_POSES = 100  # ours
EVEN_COST = 5.2  # of a frame, from 0 to 100: here it is as likely lost as not
LOST_STEEPNESS = 2.5  # by how much the log-odds rise with the logarithm of the cost
MIN_COST = 0.1  # below it the cost of a pose is no evidence

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
    """Return the posterior of the pose: 100 poses of equal weight, distributed as exp(-cost / temperature).

    `make(space, rng)` builds the optimiser of each search. The first one has so many `evaluations`, and starts where
    the problem's space says; the others start anywhere in it. All else has `share` times as many: a quarter is the
    other searches', as far as each has 200, and the rest weighs what they evaluated. Raises ValueError where a
    number makes no sense.
    """
    whole("searches", searches, 1)
    at_least("evaluations", evaluations, 1)
    positive("temperature", temperature)
    positive("share", share)
    first = gathered(searched(problem, make(problem.space, rng), evaluations))
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
    """Return the posterior of a problem after a first search, by so many more, and the evaluations that it took."""
    anywhere, others, left = replace(problem.space, start=None), list[Searched](), int(OTHER_SEARCHES * evaluations)
    count = min(searches, left // MIN_EVALUATIONS)
    for k in range(count):
        with suppress(BudgetError):  # a part that does not hold a population is left to those that come after
            others.append(gathered(searched(problem, make(anywhere, rng), left // (count - k))))
            left -= len(others[-1][1])
    used = sum(len(costs) for _, costs in others)
    landscape = Landscape(problem.space, problem.evaluate)
    symmetric = symmetric_proposals(problem, first[0][np.nanargmin(first[1])])
    every = [first, *others, *([(symmetric, landscape.costs(symmetric))] if len(symmetric) else [])]
    left = evaluations - used - landscape.evaluations
    sample = weighed(landscape, every, temperature, rng, evaluations=left)
    proposals, weights = sample.even(POSTERIOR_POSES, rng)
    return Posterior(*problem.decode(proposals), weights), used + landscape.evaluations


def searched(problem: PoseProblem, optimiser: Optimiser, evaluations: int) -> list[Searched]:
    """Return all populations (n, d) that an optimiser had evaluated within a budget, with their costs (n,)."""
    found = populations(optimiser, problem.evaluate, evaluations)
    return [(np.array(proposals), costs) for proposals, costs in found]


def gathered(populations: list[Searched]) -> Searched:
    """Return the populations of a search as one."""
    proposals, costs = zip(*populations, strict=True)
    return np.concatenate(proposals), np.concatenate(costs)


def symmetric_proposals(problem: PoseProblem, proposal: Array) -> Array:
    """Return the proposals (k, d) of a pose that is reflected as a camera sees it, or turned.

    They are as near as the prior comes to those. Poses that would face out of the box are left out, so k may be 0.
    """
    poses, translations = problem.decode(proposal[None])
    skeleton, place = problem.body.skeleton, translations[0]
    reflected = [reflected_poses(skeleton, poses, facing(camera, place)) for camera in problem.cameras]
    symmetric = np.concatenate([*reflected, turned_poses(poses)])
    space = problem.space
    within = np.abs(wrapped(symmetric[:, 0] - space.centre[0])) <= space.half[0]
    return proposals_of(space, symmetric[within], np.repeat(translations, within.sum(), axis=0))


def proposals_of(space: SearchSpace, poses: Array, translations: Array) -> Array:
    """Return the proposals (n, d) of poses (n, 66), as near as the prior and the box come to them."""
    latents = np.asarray(space.prior.transform(poses[:, 3:]))
    root, tilt = poses[:, :3].copy(), space.tilt
    if tilt is not None:
        root[:, 1:] -= tilt.at(latents)
    parts = [root, translations, latents] if space.translation == "searched" else [root, latents]
    return space.proposals(np.concatenate(parts, axis=1))


def lost_probability(costs: Array) -> Array:
    """Return how likely frames are lost whose poses cost so much: 0 to 1, of the same shape.

    A logistic model of the logarithm of the cost; the spread of the posterior, the weight of its second mode and the
    cost of the frames before added nothing on people whom it was not fitted to. docs/studies/posterior.py fits it.
    """
    return np.asarray(1.0 / (1.0 + (EVEN_COST / np.maximum(costs, MIN_COST)) ** LOST_STEEPNESS))


@dataclass(frozen=True, eq=False)
class WeighingTracker(SynthesisTracker):
    """Adds a posterior and the probability to be lost to every frame that shows the person.

    The track is the same as without. Beside the tracker's own search come others, `prediction.modes` in all, anywhere
    in the same space; they and the weighing have `prediction.modes_share` of its evaluations, beyond the budget. Where
    `modes` is 1 and the optimiser a filter, its last particles are weighed as they are.
    """

    _latest: list[tuple[PoseProblem, list[Searched]]] = field(default_factory=list, init=False, repr=False)

    def track(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        """Yield a `Frame` for each observation."""
        shown, coming = tee(observations)
        for frame, observation in zip(super().track(coming, rng), shown, strict=False):
            if not observation.usable:
                yield frame
                continue
            start, cpu_start = time.perf_counter(), time.process_time()
            posterior, more = self._posterior(*self._latest[0], rng)
            yield replace(
                frame,
                posterior=posterior,
                lost=float(lost_probability(np.array(frame.cost))),
                evaluations=frame.evaluations + more,
                seconds=frame.seconds + time.perf_counter() - start,
                cpu_seconds=None if frame.cpu_seconds is None else frame.cpu_seconds + time.process_time() - cpu_start,
            )

    def minimum(self, problem: PoseProblem, optimiser: Optimiser) -> Minimum:
        """Return the best of the search of a frame, and keep all that was evaluated."""
        found = searched(problem, optimiser, self.task.evaluations)
        self._latest[:] = [(problem, found)]
        return minimum_of(found)

    def _posterior(
        self, problem: PoseProblem, found: list[Searched], rng: np.random.Generator
    ) -> tuple[Posterior, int]:
        """Return the posterior of a frame, and how many evaluations it took."""
        how = self.prediction
        if how.modes == 1 and self.next_frame == "carry":
            particles, costs = found[-1]
            weights = boltzmann_weights(costs, how.posterior_temperature)
            if len(particles) > POSTERIOR_POSES:  # some of equal weight
                particles = particles[systematic_rows(weights, 0.5, POSTERIOR_POSES)]
                weights = np.full(POSTERIOR_POSES, 1.0 / POSTERIOR_POSES)
            return Posterior(*problem.decode(particles), weights), 0
        own = independent(rng)  # the track is the same as without
        first, more = gathered(found), round(how.modes_share * self.task.evaluations)
        return further(problem, self.make, first, more, own, how.modes - 1, how.posterior_temperature)
