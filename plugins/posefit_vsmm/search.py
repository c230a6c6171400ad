"""A search around what the filter holds: its models predict where a swarm starts, and learn from its result."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from posefit import settings as of_plugins
from posefit.arrays import Array
from posefit.fitting.box import Start
from posefit.fitting.optimiser import OptimiserFactory, minimise
from posefit.fitting.prior import Components
from posefit.fitting.problem import PoseProblem, align
from posefit.fitting.space import SearchSpace
from posefit.fitting.tracker import Observation, Task
from posefit.geometry.rotation import wrapped
from posefit.silhouette.cost import pose_costs
from posefit_vsmm.imm import Measure, Measurement
from posefit_vsmm.state import ERROR, FIRST_BONE, DependentJoints, decode, encode, free_errors, minus, plus

DIRECTIONS = 16  # that are searched beside the root: those in which the filter is least certain
STEP = 0.05  # radians to either side, from which a direction's angles are differentiated
MIN_BUDGET = 80  # evaluations; with fewer, the filter's own pose is as good
REACH = 3.5  # deviations to either side
ADDED_DEVIATIONS = np.repeat([0.02, np.radians(4.0)], [3, ERROR - 3])  # metres and radians, to the filter's
# Where in an error the whole body's yaw, pitch and roll are: small turns about its y, x and z
YAW_PITCH_ROLL = [4, 3, 5]
MIN_ROOT_DEVIATIONS = np.radians([6.0, 4.0, 4.0])  # of yaw, pitch and roll
# How far what a search finds is off, as one silhouette lets it be: metres across, up and along the depth, then radians
# of the whole body and of the bones
SEARCH_DEVIATIONS = np.repeat([0.03, 0.03, 0.08, np.radians(6.0), np.radians(9.0)], [1, 1, 1, 3, ERROR - FIRST_BONE])


class Directions(Components):
    """Joint angles are a mean and a sum of directions that need not be orthonormal."""

    @classmethod
    def of(cls, state: Array, covariance: Array, dependent: DependentJoints, count: int) -> "Directions":
        """Return the `count` directions of a state (43,) in which its covariance (33, 33) is largest.

        They are principal axes of the bones' part of the covariance, carried over to joint angles.
        """
        values, vectors = np.linalg.eigh(covariance[FIRST_BONE:, FIRST_BONE:])
        chosen = np.argsort(values)[::-1][:count]
        errors = np.zeros((1 + 2 * len(chosen), len(covariance)))
        errors[1:, FIRST_BONE:] = STEP * np.concatenate([vectors[:, chosen].T, -vectors[:, chosen].T])
        poses, _ = decode(plus(state, errors), dependent)
        mean, ahead, back = np.split(poses[:, 3:], [1, 1 + len(chosen)])
        ranges = REACH * np.sqrt(values[chosen])
        return cls(mean[0], wrapped(ahead - back) / (2.0 * STEP), -ranges, ranges)  # central differences

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) that come nearest to joint angles (n, 63)."""
        return np.asarray(wrapped(angles - self.mean) @ np.linalg.pinv(self.components))


class SearchResult(NamedTuple):
    """What a search around the filter's state finds."""

    pose: Array  # (66,)
    evaluations: int
    measure: Measure  # its measurement, for the filter


@dataclass(frozen=True, eq=False)
class Search:
    """A search around what the filter holds."""

    task: Task
    dependent: DependentJoints
    factory: OptimiserFactory = field(repr=False)
    weight: float  # of a silhouette's cost in a model's log-likelihood

    def log_likelihoods(self, states: Array, observation: Observation) -> Array:
        """Return the log-likelihoods (r,) of predicted states (r, 43): their silhouettes' costs, weighed."""
        return -self.weight * aligned_costs(self.task, observation, self.dependent, states)[0]

    def best(
        self, state: Array, spread: Array, observation: Observation, budget: int, rng: np.random.Generator
    ) -> SearchResult | None:
        """Return the best pose around a state (43,) with covariance (33, 33); None where the budget is too small."""
        if budget < MIN_BUDGET:
            return None
        poses, places = decode(state[None], self.dependent)
        around = spread + np.diag((ADDED_DEVIATIONS * free_errors(self.task.body.skeleton)) ** 2)
        prior = Directions.of(state, around, self.dependent, DIRECTIONS)
        root = np.maximum(np.sqrt(np.diag(around)[YAW_PITCH_ROLL]), MIN_ROOT_DEVIATIONS)
        space = SearchSpace(prior, poses[0, :3], REACH * root, places[0], self.task.translation)
        zeros = np.zeros(space.dimensions)
        start = Start(zeros, np.full(space.dimensions, 1.0 / REACH), zeros)
        space = space.around(space.centre, start, observation.translation)
        penalty = 0.5 * REACH**2 / self.weight  # of a proposal at the box's border
        scene = self.task.body, self.task.cameras, observation.silhouettes
        problem = PoseProblem(*scene, space, threads=self.task.threads, blank=True)
        optimiser = self.factory(space, rng, **of_plugins.planned(self.factory, {}, budget))

        def posterior(proposals: Array) -> Array:  # in units of cost, less a constant
            return np.asarray(problem.evaluate(proposals) + penalty * (proposals**2).sum(axis=1))

        best = minimise(posterior, optimiser, budget, budget_known=True)
        pose, place = problem.decode(best.proposal[None])
        best_state = encode(pose, place)[0]

        def measure(states: Array) -> Measurement:
            jacobians = np.tile(np.eye(ERROR), (len(states), 1, 1))
            return Measurement(minus(best_state, states), jacobians, np.diag(SEARCH_DEVIATIONS**2))

        return SearchResult(pose[0], best.evaluations, measure)


def aligned_costs(
    task: Task, observation: Observation, dependent: DependentJoints, states: Array
) -> tuple[Array, Array]:
    """Return the costs (n,) of states (n, 43) in an observation, and the states, moved to where they fit it."""
    poses, places = decode(states, dependent)
    scene, known = (task.body, task.cameras, observation.silhouettes), observation.translation
    places = align(*scene, poses, places) if known is None else np.tile(known, (len(states), 1))
    return pose_costs(*scene, poses, places, threads=task.threads)[0], np.column_stack([places, states[:, 3:]])
