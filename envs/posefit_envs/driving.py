"""Optimisers that search by stepping an environment, and trackers that give its references."""

from collections.abc import Generator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium import Env, error
from gymnasium.vector import VectorEnv

from posefit import Optimiser, Problem, SearchSpace, minimise
from posefit.arrays import Array
from posefit.fitting.problem import BudgetError
from posefit.motion.clips import training_clips, training_motions
from posefit.reading import quoted
from posefit.registry import registry
from posefit.settings import check, planned
from posefit.tracking.method import prepare
from posefit.tracking.options import TrackOptions
from posefit_envs.fit import FitImageEnv, FitImageVectorEnv
from posefit_envs.track import TrackEnv, committed_infos


class EnvObjective:
    """The costs of proposals by stepping `posefit/FitImage-v0`, a single one or a vector.

    An episode that ends begins again with the same instance. Raises gymnasium.error.Error for another environment.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any] | Env[Any, Any]) -> None:
        bare = env.unwrapped
        if not isinstance(bare, FitImageEnv | FitImageVectorEnv):
            raise error.Error(
                f"env must be posefit/FitImage-v0, got {type(bare).__name__}"
            )
        self._env = env
        self._bare = bare
        self._vector = isinstance(env, VectorEnv)
        self._count = env.num_envs if isinstance(env, VectorEnv) else 1
        self._instances: Any = None

    def begin(
        self, seed: int, instance: int | Sequence[int] | None
    ) -> tuple[list[SearchSpace], list[int]]:
        """Reset with an instance for all or each, or with random ones; return what each searches, and their numbers."""
        self._instances = self._env.reset(seed=seed, options={"instance": instance})[1][
            "instance"
        ]
        bare = self._bare
        problems = [bare.problem] if isinstance(bare, FitImageEnv) else bare.problems
        return [problem.space for problem in problems], np.atleast_1d(
            self._instances
        ).tolist()

    def step(self, proposals: Array) -> Array:
        """Return the costs (n,) of proposals (n, d), one in each environment."""
        _, _, terminated, truncated, infos = self._env.step(
            proposals if self._vector else proposals[0]
        )
        costs = np.array(infos["cost"])
        done = np.logical_or(terminated, truncated)
        if done.any():
            mask = {"reset_mask": done} if self._vector else {}
            self._env.reset(options={"instance": self._instances, **mask})
        return np.atleast_1d(costs)

    def costs(self, proposals: Array) -> Array:
        """Return the costs (m,) of any number of proposals (m, d), in environments of one instance."""
        filling = np.repeat(proposals[-1:], -len(proposals) % self._count, axis=0)
        turns = np.concatenate([proposals, filling]).reshape(
            -1, self._count, proposals.shape[1]
        )
        return np.concatenate([self.step(turn) for turn in turns])[: len(proposals)]


def drive(
    env: VectorEnv[Any, Any, Any] | Env[Any, Any],
    optimiser: str | Optimiser = "sapso",
    *,
    seed: int = 0,
    instance: int | None = None,
    evaluations: int = 2440,
    **settings: Any,
) -> Problem:
    """Return the problem, minimised by an optimiser that steps `posefit/FitImage-v0`, a single one or a vector.

    A population of any size is proposed in as many steps as it takes; the last of them is filled up with its last
    proposal, which does not count. An episode that ends begins again with the same instance: only `evaluations` end the
    search. Actions are float64, so the result is the library's, bit for bit. Raises gymnasium.error.Error for another
    environment, where the budget does not hold one population, and where the environments have several instances:
    `drive_each` is for those.
    """
    objective = EnvObjective(env)
    (space, *_), numbers = objective.begin(seed, instance)
    if len(set(numbers)) > 1:
        raise error.Error(
            f"instance must be the same in all environments, got {quoted(numbers)}: use drive_each"
        )
    if isinstance(optimiser, str):
        optimiser = _optimiser(space, optimiser, seed, evaluations, settings)
    try:
        problem = Problem(objective.costs, space, evaluations)
        return minimise(problem, optimiser, budget_known=True)
    except BudgetError as mistake:
        raise error.Error(str(mistake)) from None


def drive_each(
    env: VectorEnv[Any, Any, Any],
    optimiser: str = "sapso",
    *,
    seed: int = 0,
    instances: Sequence[int] | None = None,
    evaluations: int = 2440,
    **settings: Any,
) -> list[Problem]:
    """Return the problem of each environment of a vector of `FitImage-v0`, minimised by a search of its own.

    The searches run side by side, a proposal of each in a step, with a population of any size and the seeds `seed`,
    `seed` + 1 and so on. `instances` names an instance for each environment; by default each has a random one. Raises
    gymnasium.error.Error as `drive` does.
    """
    objective = EnvObjective(env)
    problems = []
    searches = []
    for i, space in enumerate(objective.begin(seed, instances)[0]):
        problem = Problem(objective.step, space, evaluations)
        made = _optimiser(space, optimiser, seed + i, evaluations, settings)
        problems.append(problem)
        searches.append(_stepwise(problem, made))
    proposals = np.stack([next(search) for search in searches])
    searching = set(range(len(searches)))
    while searching:
        costs = objective.step(proposals).tolist()
        for i in sorted(searching):
            try:
                proposals[i] = searches[i].send(costs[i])
            except StopIteration:
                searching.remove(i)
                proposals[i] = 0.0
    return problems


def track_reference(
    env: Env[Any, Any],
    tracker: str = "exemplars",
    *,
    seed: int = 0,
    train: Sequence[str] = (),
    **settings: Any,
) -> list[dict[str, Any]]:
    """Return the infos of what a tracker would commit in each frame of the current episode of `posefit/Track-v0`.

    The tracker has the environment's budget for a frame, and the same silhouettes: all of them, if it looks ahead, so
    it is a reference for policies and no policy. Its poses need not lie in the box of proposals. It learns from
    `train`, named as in `posefit.track`; by default from what the environment's prior learns from. The episode is not
    stepped. Raises gymnasium.error.ResetNeeded before the first reset, gymnasium.error.Error for another environment,
    and ValueError where a name or a setting is wrong.
    """
    bare = env.unwrapped
    if not isinstance(bare, TrackEnv):
        raise error.Error(f"env must be posefit/Track-v0, got {type(bare).__name__}")
    instance = bare.instance
    world = bare.world
    motions = training_motions(
        training_clips(
            train or world.training, followed=world.motion_of(instance.number)
        ),
        instance.task.fps,
    )
    task = replace(instance.task, training=motions)
    tracker_settings = {
        f"{tracker.partition(':')[0]}.{name}": value for name, value in settings.items()
    }
    method = prepare(TrackOptions(method=tracker, settings=tracker_settings), task)
    frames = method.follow(task, instance.observations, np.random.default_rng(seed))
    return [
        committed_infos(
            instance, k, frame.pose, frame.translation, frame.cost, errors=True
        )
        for k, frame in enumerate(frames)
    ]


def _stepwise(problem: Problem, optimiser: Optimiser) -> Generator[Array, float, None]:
    """Yield the proposals (d,) of an optimiser, each to be sent its cost, as `minimise` would evaluate them.

    Raises gymnasium.error.Error where the budget does not hold one population.
    """
    while len(proposals := optimiser.ask()):
        if len(proposals) > problem.remaining_evaluations:
            break
        costs = np.empty(len(proposals))
        for k, proposal in enumerate(proposals):
            costs[k] = yield proposal
        problem.count(proposals, costs)
        optimiser.tell(proposals, costs)
    if not problem.evaluations:
        raise error.Error(
            f"evaluations must hold one population of {len(proposals)}, got {problem.budget}"
        )


def _optimiser(
    space: SearchSpace, name: str, seed: int, evaluations: int, settings: dict[str, Any]
) -> Optimiser:
    offer = registry().offer("optimiser", name)
    all_settings = planned(
        offer.factory, check(offer.name, offer.factory, settings), evaluations
    )
    optimiser: Optimiser = offer.factory(
        space, np.random.default_rng(seed), **all_settings
    )
    return optimiser
