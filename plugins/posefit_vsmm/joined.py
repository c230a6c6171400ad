"""`sapso+vsmm`: the motion models of `vsmm` predict where a swarm starts, and learn from what it finds."""

from dataclasses import dataclass, field

import numpy as np

from posefit import settings as of_plugins
from posefit.arrays import Array
from posefit.fitting.box import Start
from posefit.fitting.check import at_least, positive
from posefit.fitting.optimiser import OptimiserFactory, minimise
from posefit.fitting.prior import Components
from posefit.fitting.problem import PoseProblem
from posefit.fitting.space import SearchSpace
from posefit.fitting.tracker import Observation, Task
from posefit.geometry.rotation import wrapped
from posefit.registry import registry
from posefit_vsmm.imm import PLACED, Measurement
from posefit_vsmm.motion import library
from posefit_vsmm.settings import Settings
from posefit_vsmm.state import ERROR, FIRST_BONE, YAW_PITCH_ROLL, Reliance, decode, encode, free_errors
from posefit_vsmm.switching import Measure
from posefit_vsmm.tracker import VSMM, matched

STEP = 0.05  # radians to either side, from which a direction's angles are differentiated


class Directions(Components):
    """Joint angles are a mean and a sum of directions that need not be orthonormal."""

    @classmethod
    def of(cls, state: Array, covariance: Array, reliance: Reliance, count: int, reach: float) -> "Directions":
        """Return the `count` directions of a state (43,) in which its covariance (33, 33) is largest.

        They are principal axes of the bones' part of the covariance, carried over to joint angles.
        Their range is `reach` standard deviations to either side.
        """
        values, vectors = np.linalg.eigh(covariance[FIRST_BONE:, FIRST_BONE:])
        chosen = np.argsort(values)[::-1][:count]
        errors = np.zeros((2 * len(chosen), len(covariance)))
        errors[:, FIRST_BONE:] = np.concatenate([vectors[:, chosen].T, -vectors[:, chosen].T]) * STEP
        poses, _ = decode(np.array([state, *(PLACED.plus(state, error) for error in errors)]), reliance)
        middle, ahead, back = np.split(poses[:, 3:], [1, 1 + len(chosen)])
        ways = wrapped(ahead - back) / (2.0 * STEP)  # central differences
        far = reach * np.sqrt(values[chosen])
        return cls(middle[0], ways, -far, far)

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) that come nearest to joint angles (n, 63)."""
        return np.asarray(wrapped(angles - self.mean) @ np.linalg.pinv(self.components))

    def inverse_transform(self, latents: Array) -> Array:
        """Return the joint angles (n, 63) of latents (n, m)."""
        return np.asarray(self.mean + (latents[:, :, None] * self.components).sum(axis=1))


LEAST = np.repeat([0.02, np.radians(4.0)], [3, ERROR - 3])  # metres and radians: deviations added to the filter's
LEAST_BUDGET = 80  # evaluations; with fewer, the filter's own pose is as good
REACH = 3.5  # deviations to either side
ROOT_LEAST = np.radians([6.0, 4.0, 4.0])  # deviations of yaw, pitch and roll, at the least
# How far what a search finds is off, as one silhouette lets it be: metres across, up and along the depth, then radians
# of the whole body and of the bones
SEARCH_DEVIATIONS = np.repeat([0.03, 0.03, 0.08, np.radians(6.0), np.radians(9.0)], [1, 1, 1, 3, ERROR - FIRST_BONE])


@dataclass(frozen=True, eq=False)
class Search:
    """A search around what the filter holds."""

    task: Task
    reliance: Reliance
    factory: OptimiserFactory = field(repr=False)
    dimensions: int
    weight: float  # of a silhouette's cost in a model's log-likelihood

    def likelihood(self, state: Array, observation: Observation) -> float:
        """Return the log-likelihood of a predicted state (43,): its silhouette's cost, weighed."""
        return -self.weight * float(matched(self.task, observation, self.reliance, state[None])[0][0])

    def find(
        self, state: Array, spread: Array, observation: Observation, budget: int, rng: np.random.Generator
    ) -> tuple[Array, int, Measure] | None:
        """Return the best pose (66,) around a state (43,) with covariance (33, 33), and its measurement of the filter.

        Between them are the evaluations that it took; None where the budget is too small.
        """
        if budget < LEAST_BUDGET:
            return None
        poses, places = decode(state[None], self.reliance)
        around = spread + np.diag((LEAST * free_errors(self.task.body.skeleton)) ** 2)
        prior = Directions.of(state, around, self.reliance, self.dimensions, REACH)
        root = np.maximum(np.sqrt(np.diag(around)[[*YAW_PITCH_ROLL]]), ROOT_LEAST)
        space = SearchSpace(prior, poses[0, :3], REACH * root, places[0], self.task.translation)
        start = np.full(space.dimensions, 1.0 / REACH)
        space = space.around(space.centre, Start(np.zeros(space.dimensions), start, np.zeros(space.dimensions)))
        if observation.translation is not None:
            space = space.around(space.centre, space.start, observation.translation)
        doubt = 0.5 * REACH**2 / self.weight  # of a proposal at the box's border
        problem = PoseProblem(
            self.task.body, self.task.cameras, observation.silhouettes, space, threads=self.task.threads, blank=True
        )
        optimiser = self.factory(space, rng, **of_plugins.planned(self.factory, {}, budget))

        def posterior(proposals: Array) -> Array:  # in units of cost, less a constant
            return np.asarray(problem.evaluate(proposals) + doubt * (proposals**2).sum(axis=1))

        best = minimise(posterior, optimiser, budget, budget_known=True)
        pose, place = problem.decode(best.proposal[None])
        best_state = encode(pose, place)[0]

        def measure(one: Array) -> Measurement:
            return Measurement(PLACED.minus(best_state, one), np.eye(ERROR), np.diag(SEARCH_DEVIATIONS**2))

        return pose[0], best.evaluations, measure


def joined(
    task: Task,
    *,
    optimiser: str = "sapso",
    dimensions: int = 16,
    weight: float = 0.25,
    groups: str = "",
) -> VSMM:
    """The motion models of `vsmm` predict where a swarm starts, and learn from what it finds.

    Settings:
        optimiser: name of any registered one, with its own defaults.
        dimensions: directions that it searches beside the root, 1 or more; those in which the filter is least sure.
        weight: of a prediction's silhouette cost, 0 to 100, in its model's log-likelihood; above 0. Ours.
        groups: path of a TOML file of groups and neighbours; "" is the package's own. VSMM step 4, Interpretation V1.
    """
    at_least("dimensions", dimensions, 1)
    positive("weight", weight)
    search = Search(task, library().reliance, registry().optimiser(optimiser), dimensions, weight)
    return VSMM(task, Settings(groups=groups), search)
