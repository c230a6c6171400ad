"""What searches a library searches an environment: optimisers step it, and trackers give its references."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium import Env, error
from gymnasium.vector import VectorEnv

from posefit import Minimum, Optimiser, SearchSpace, minimise
from posefit.fitting.optimiser import BudgetError
from posefit.footage.training import training_clips, training_motions
from posefit.reading import quoted
from posefit.registry import registry
from posefit.settings import check, planned
from posefit.tracking.method import prepare
from posefit.tracking.options import TrackOptions
from posefit_envs.searched.desk import Desk
from posefit_envs.searched.stepwise import Stepwise
from posefit_envs.track import TrackEnv, committed


def drive(
    env: VectorEnv[Any, Any, Any] | Env[Any, Any],
    optimiser: str | Optimiser = "sapso",
    *,
    seed: int = 0,
    instance: int | None = None,
    evaluations: int = 2440,
    dtype: Any = np.float64,
    **settings: Any,
) -> Minimum:
    """Return what an optimiser finds by stepping `posefit/Fit-v0` or `Fit-v1`: one environment, or a vector of them.

    A population of any size is proposed in as many steps as it takes; what is left over in the last of them is filled
    up with its last proposal, which counts for nothing. An episode that ends, at its target or with its budget, begins
    anew with the same instance: `evaluations` alone end the search. Actions go in as float64, so the result is the
    library's, bit for bit. With `dtype` numpy.float32, what the action space asks of others, a proposal is rounded to 7
    digits; a pixel at a silhouette's edge may then count otherwise, and from the first such pixel on the search goes
    another way. Raises gymnasium.error.Error for another environment, and where the budget does not hold one
    population or the environments have not all the same instance; `drive_each` is for those.
    """
    desk = Desk(env, dtype)
    numbers = desk.begin(seed, instance)
    if len(set(numbers)) > 1:
        raise error.Error(f"instance must be the same in all environments, got {quoted(numbers)}: use drive_each")
    searching = (
        _built(desk.space(0), optimiser, seed, evaluations, settings) if isinstance(optimiser, str) else optimiser
    )
    try:
        return minimise(desk.costs, searching, evaluations, told=True)
    except BudgetError as mistake:
        raise error.Error(str(mistake)) from None


def drive_each(
    env: VectorEnv[Any, Any, Any],
    optimiser: str = "sapso",
    *,
    seed: int = 0,
    instances: Sequence[int] | None = None,
    evaluations: int = 2440,
    dtype: Any = np.float64,
    **settings: Any,
) -> list[Minimum]:
    """Return what an optimiser finds in each environment of a vector of `posefit/Fit-v0` or `Fit-v1`, by itself.

    The searches run side by side, a proposal of each in a step, with a population of any size and the seeds `seed`,
    `seed` + 1 and so on. `instances` names an instance for each environment; without, each draws its own. Raises
    gymnasium.error.Error as `drive` does.
    """
    desk = Desk(env, dtype)
    count = len(desk.begin(seed, instances))
    searches = [
        Stepwise(_built(desk.space(i), optimiser, seed + i, evaluations, settings), evaluations) for i in range(count)
    ]
    while any(search.waiting for search in searches):
        rows = np.stack([search.following() for search in searches])
        for search, cost in zip(searches, desk.step(rows).tolist(), strict=True):
            search.told(cost)
    return [search.found() for search in searches]


def track_reference(
    env: Env[Any, Any], tracker: str = "exemplars", *, seed: int = 0, train: Sequence[str] = (), **settings: Any
) -> list[dict[str, Any]]:
    """Return what a tracker would commit in each frame of the current episode of `posefit/Track-v0`, as infos say it.

    It has the environment's budget for a frame, and sees the same silhouettes: all of them, if it looks ahead, so it is
    a measure for policies and no policy. Its poses need not lie in the box of proposals. It learns from `train`, named
    as in `posefit.track`; by default from what the environment's prior learns from. The episode is not stepped. Raises
    gymnasium.error.ResetNeeded before the first reset, gymnasium.error.Error for another environment, and ValueError
    where a name or a setting is wrong.
    """
    followed = env.unwrapped
    if not isinstance(followed, TrackEnv):
        raise error.Error(f"env must be posefit/Track-v0, got {type(followed).__name__}")
    made, world = followed.instance, followed.world
    motions = training_motions(training_clips(train or world.training, followed=world.motion), made.task.fps)
    task = replace(made.task, training=motions)
    own = {f"{tracker.partition(':')[0]}.{name}": value for name, value in settings.items()}
    method = prepare(TrackOptions(method=tracker, settings=own), task)
    frames = method.tracker(task).track(made.observations, np.random.default_rng(seed))
    return [
        committed(made, k, frame.pose, frame.translation, frame.cost, errors=True) for k, frame in enumerate(frames)
    ]


def _built(space: SearchSpace, name: str, seed: int, evaluations: int, settings: dict[str, Any]) -> Optimiser:
    offer = registry().offer("optimiser", name)
    filled = planned(offer.factory, settings, evaluations)
    check(offer.name, offer.factory, filled)
    made: Optimiser = offer.factory(space, np.random.default_rng(seed), **filled)
    return made
