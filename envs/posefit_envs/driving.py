"""Optimisers that search by stepping an environment, and trackers that give its references."""

from collections.abc import Generator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium import ActionWrapper, Env, error
from gymnasium.vector import VectorActionWrapper, VectorEnv

from posefit import Optimiser, Problem, SearchSpace, minimise
from posefit.arrays import Array
from posefit.fitting.problem import BudgetError
from posefit.motion.clips import training_clips, training_motions
from posefit.reading import quoted
from posefit.registry import registry
from posefit.settings import check, planned
from posefit.tracking.method import prepare
from posefit.tracking.options import TrackOptions
from posefit_envs.rows import AnyEnv, rows_of
from posefit_envs.track import TrackEnv, committed_infos


class FitImageSteps:
    """Costs of proposals by stepping `posefit/FitImage-v0`: a single environment or a vector, in any autoreset mode.

    An episode that ends begins again with the same instance. Raises gymnasium.error.Error for another environment, and
    for one whose wrappers change actions.
    """

    def __init__(self, env: AnyEnv) -> None:
        _check_actions_reach(env)
        self._env = env
        self._rows = rows_of(env)
        self._numbers: list[int] = []

    def begin(
        self, seed: int, instances: int | Sequence[int] | None
    ) -> tuple[list[SearchSpace], list[int]]:
        """Reset with an instance for all or each, or with random ones; return what each searches, and their numbers."""
        rows = self._rows
        chosen: Any = instances
        if instances is None or isinstance(instances, int | np.integer):
            chosen = [instances] * rows.count
        options = [{"instance": number} for number in chosen]
        _, infos = rows.reset([seed + i for i in range(rows.count)], options)
        self._numbers = [int(info["instance"]) for info in infos]
        return rows.attribute("space"), self._numbers

    def step(self, proposals: Array) -> Array:
        """Return the costs (n,) of proposals (n, d), one in each environment."""
        _, _, ended, infos = self._rows.step(proposals)
        if ended.any():
            options = [{"instance": number} for number in self._numbers]
            self._rows.reset(None, options, ended)
        return np.array([info["cost"] for info in infos])

    def costs(self, proposals: Array) -> Array:
        """Return the costs (m,) of any number of proposals (m, d), in environments of one instance."""
        count = self._rows.count
        filling = np.repeat(proposals[-1:], -len(proposals) % count, axis=0)
        turns = np.concatenate([proposals, filling])
        turns = turns.reshape(-1, count, proposals.shape[1])
        costs = np.concatenate([self.step(turn) for turn in turns])
        return costs[: len(proposals)]


def _check_actions_reach(env: AnyEnv) -> None:
    """Raise gymnasium.error.Error for another environment than FitImage-v0, and where a wrapper changes actions."""
    wrapper: Any = env
    while wrapper is not env.unwrapped:
        if isinstance(wrapper, ActionWrapper | VectorActionWrapper):
            raise error.Error(
                f"env must take proposals as they are, got {type(wrapper).__name__}: "
                "drive the environment that it wraps"
            )
        wrapper = wrapper.env
    try:
        (space, *_) = rows_of(env).attribute("action_space")
        rows_of(env).attribute("max_evaluations")
    except AttributeError:
        raise error.Error(
            f"env must be posefit/FitImage-v0, got {type(env.unwrapped).__name__}"
        ) from None
    if (space.low != -1.0).any() or (space.high != 1.0).any():
        raise error.Error(f"env must take proposals in [-1, 1], got actions in {space}")


def drive(
    env: AnyEnv,
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
    search. Actions are float64, so the result is the library's, bit for bit, in every autoreset mode. Raises
    gymnasium.error.Error for another environment or one whose wrappers change actions, where the budget does not hold
    one population, and where the environments have several instances: `drive_each` is for those.
    """
    steps = FitImageSteps(env)
    (space, *_), numbers = steps.begin(seed, instance)
    if len(set(numbers)) > 1:
        raise error.Error(
            f"instance must be the same in all environments, got {quoted(numbers)}: use drive_each"
        )
    if isinstance(optimiser, str):
        optimiser = _optimiser(space, optimiser, seed, evaluations, settings)
    problem = Problem(steps.costs, space, evaluations)
    try:
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
    steps = FitImageSteps(env)
    problems = []
    searches = []
    for i, space in enumerate(steps.begin(seed, instances)[0]):
        problem = Problem(steps.costs, space, evaluations)
        made = _optimiser(space, optimiser, seed + i, evaluations, settings)
        problems.append(problem)
        searches.append(_stepwise(problem, made))
    proposals = np.stack([next(search) for search in searches])
    searching = set(range(len(searches)))
    while searching:
        costs = steps.step(proposals).tolist()
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
