"""Optimisers that search by stepping an environment; trackers as a reference."""

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
from posefit_envs.corrections import Corrections
from posefit_envs.rows import AnyEnv, rows_of
from posefit_envs.track import TrackEnv, committed_infos


class FitImageSteps:
    """Costs of proposals, found by stepping `posefit/FitImage-v1`.

    The environment is a single one or a vector, in any autoreset mode. An episode that
    ends begins again with the same instance.

    Raises:
        gymnasium.error.Error: For another environment, or if a wrapper changes actions.
    """

    def __init__(self, env: AnyEnv) -> None:
        _check_actions_reach(env)
        self._env = env
        self._rows = rows_of(env)
        self._numbers: list[int] = []

    def begin(
        self, seed: int, instances: int | Sequence[int] | None
    ) -> tuple[list[SearchSpace], list[int]]:
        """Reset, and return the search space and instance number of each row.

        `instances` is one number for all, a list, or None for random instances.
        """
        rows = self._rows
        chosen: Any = instances
        if instances is None or isinstance(instances, int | np.integer):
            chosen = [instances] * rows.count
        options = [{"instance": number} for number in chosen]
        seeds = list(range(seed, seed + rows.count))
        _, infos = rows.reset(seeds, options)
        self._numbers = [int(info["instance"]) for info in infos]
        return rows.attribute("space"), self._numbers

    def step(self, proposals: Array) -> Array:
        """Return the costs (n,) of proposals (n, d), one in each environment."""
        _, _, ended, infos = self._rows.step(proposals)
        # a search continues over many episodes, always with the same instance
        if ended.any():
            options = [{"instance": number} for number in self._numbers]
            self._rows.reset(None, options, ended)
        return np.array([info["cost"] for info in infos])

    def costs(self, proposals: Array) -> Array:
        """Return the costs (m,) of proposals (m, d); all rows share one instance.

        The number of proposals need not be a multiple of the number of rows.
        """
        count = self._rows.count
        # every row must step, so repeat the last proposal until the last step is full
        filling = np.repeat(proposals[-1:], -len(proposals) % count, axis=0)
        turns = np.concatenate([proposals, filling])
        turns = turns.reshape(-1, count, proposals.shape[1])
        costs = np.concatenate([self.step(turn) for turn in turns])
        return costs[: len(proposals)]


def _check_actions_reach(env: AnyEnv) -> None:
    """Raise gymnasium.error.Error unless actions reach FitImage-v1 unchanged."""
    wrapper: Any = env
    while wrapper is not env.unwrapped:
        if isinstance(wrapper, ActionWrapper | VectorActionWrapper | Corrections):
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
            f"env must be posefit/FitImage-v1, got {type(env.unwrapped).__name__}"
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
    """Search by stepping `posefit/FitImage-v1`, and return the problem.

    A population takes as many steps as it needs. If it does not fill the last step, its
    last proposal is repeated; repeats are not counted. An episode that ends begins
    again with the same instance, so only `evaluations` end the search. Actions are
    float64: the result is the library's, bit for bit, in every autoreset mode.

    Args:
        env: A single environment, or a vector whose environments share one instance.
        optimiser: A name, or an optimiser that was made for the search space.
        seed: Seed of the environments and the optimiser.
        instance: Number of the instance; by default a random one.
        evaluations: The budget.
        settings: Settings of the optimiser.

    Returns:
        The problem, with the best proposal and the count of evaluations.

    Raises:
        gymnasium.error.Error: For another environment, if a wrapper changes actions, if
            the budget is below one population, or if the instances differ (use
            `drive_each`).

    Example:
        >>> import gymnasium as gym
        >>> from posefit_envs import drive
        >>> name = "posefit_envs:posefit/FitImage-v1"
        >>> many = gym.make_vec(name, num_envs=40, instance=17, max_evaluations=10**6)
        >>> drive(many, "pso", evaluations=200).evaluations
        200
    """
    steps = FitImageSteps(env)
    (space, *_), numbers = steps.begin(seed, instance)
    if len(set(numbers)) > 1:
        raise error.Error(
            "instance must be the same in all environments, "
            f"got {quoted(numbers)}: use drive_each"
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
    """Run a separate search in each environment, and return the problems.

    The searches run side by side: each step evaluates one proposal of each. Populations
    may have any size. The seeds are `seed`, `seed` + 1 and so on.

    Args:
        env: A vector of `FitImage-v1`.
        optimiser: The optimiser's name.
        seed: Seed of the first search.
        instances: An instance for each environment; by default random ones.
        evaluations: The budget of each search.
        settings: Settings of the optimiser.

    Returns:
        The problems, in the order of the environments.

    Raises:
        gymnasium.error.Error: As in `drive`, except that instances may differ.

    Example:
        >>> import gymnasium as gym
        >>> from posefit_envs import drive_each
        >>> many = gym.make_vec("posefit_envs:posefit/FitImage-v1", num_envs=2)
        >>> problems = drive_each(many, "pso", instances=[3, 4], evaluations=80)
        >>> [problem.evaluations for problem in problems]
        [80, 80]
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
                # a row must step with the others: any proposal will do
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
    """Return the infos of the poses that a tracker commits in a Track-v1 episode.

    The tracker has the environment's budget for a frame, and the same silhouettes. If
    it looks ahead, it reads all of them, so it is a reference for policies and not a
    policy. Its poses may lie outside the box of proposals. The episode is not stepped.

    Args:
        env: `posefit/Track-v1`, after a reset.
        tracker: The tracker's name.
        seed: Seed of the tracker.
        train: Training motions, named as in `posefit.track`; by default the training
            motions of the environment's prior.
        settings: Settings of the tracker.

    Returns:
        The infos, one for each frame.

    Raises:
        gymnasium.error.ResetNeeded: Before the first reset.
        gymnasium.error.Error: For another environment.
        ValueError: If a name or a setting is wrong.

    Example:
        >>> import gymnasium as gym
        >>> from posefit_envs import track_reference
        >>> env = gym.make("posefit_envs:posefit/Track-v1", instance=17)
        >>> _ = env.reset(seed=0)
        >>> frames = track_reference(env, "sapso@pca")
        >>> "committed_mpjpe_mm" in frames[0]
        True
    """
    bare = env.unwrapped
    if not isinstance(bare, TrackEnv):
        raise error.Error(f"env must be posefit/Track-v1, got {type(bare).__name__}")
    instance = bare.instance
    world = bare.world
    # the environment's prior may have learned from this motion; a tracker that is given
    # training motions must not
    followed = world.motion_of(instance.number) if train else None
    clips = training_clips(train or world.training, followed=followed)
    motions = training_motions(clips, instance.task.fps)
    task = replace(instance.task, training=motions)
    # a variant, named `tracker:variant`, has the settings of its tracker
    family = tracker.partition(":")[0]
    tracker_settings = {}
    for name, value in settings.items():
        tracker_settings[f"{family}.{name}"] = value
    method = prepare(TrackOptions(method=tracker, settings=tracker_settings), task)
    frames = method.follow(task, instance.observations, np.random.default_rng(seed))
    infos = []
    for k, frame in enumerate(frames):
        infos.append(
            committed_infos(
                instance, k, frame.pose, frame.translation, frame.cost, errors=True
            )
        )
    return infos


def _stepwise(problem: Problem, optimiser: Optimiser) -> Generator[Array, float, None]:
    """Yield an optimiser's proposals (d,) one by one; each must be sent its cost.

    Raises gymnasium.error.Error if the budget is below one population.
    """
    while len(proposals := optimiser.ask()):
        if len(proposals) > problem.remaining_evaluations:
            break
        costs = np.empty(len(proposals))
        for k, proposal in enumerate(proposals):
            costs[k] = yield proposal
        # counted here: the costs are those of steps, and the problem was never called
        problem.count(proposals, costs)
        optimiser.tell(proposals, costs)
    if not problem.evaluations:
        raise error.Error(
            f"evaluations must be at least {len(proposals)}, one population, "
            f"got {problem.budget}"
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
