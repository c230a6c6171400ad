"""What searches a library searches an environment: optimisers step it, and trackers give its references."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium import Env, error
from gymnasium.vector import VectorEnv

from posefit import Minimum, Optimiser, minimise
from posefit.fitting.optimiser import BudgetError
from posefit.footage.training import training_clips, training_motions
from posefit.registry import registry
from posefit.settings import check, planned
from posefit.tracking.method import Choice, prepare
from posefit_envs.track import TrackEnv, committed


def drive(
    env: VectorEnv[Any, Any, Any],
    optimiser: str | Optimiser = "sapso",
    *,
    seed: int = 0,
    instance: int | None = None,
    evaluations: int = 2440,
    dtype: Any = np.float64,
    **settings: Any,
) -> Minimum:
    """Return what an optimiser finds by stepping `posefit/Fit-v0` in its vector form, with whole populations.

    A population is proposed in as many steps as it has multiples of `num_envs` rows. Actions go in as float64, so the
    result is the library's, bit for bit. With `dtype` numpy.float32, what the action space asks of others, a proposal
    is rounded to 7 digits; a pixel at a silhouette's edge may then count otherwise, and from the first such pixel on
    the search goes another way. Raises gymnasium.error.Error where the population is no multiple of `num_envs`, or an
    episode ends before the search does.
    """
    options = {} if instance is None else {"options": {"instance": instance}}
    env.reset(seed=seed, **options)
    searching = _built(env, optimiser, seed, evaluations, settings) if isinstance(optimiser, str) else optimiser
    try:
        return minimise(lambda proposals: _costs(env, proposals.astype(dtype)), searching, evaluations, told=True)
    except BudgetError as mistake:
        raise error.Error(str(mistake)) from None


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
    method = prepare(Choice(tracker=tracker, tracker_settings=settings), task)
    frames = method.tracker(task).track(made.observations, np.random.default_rng(seed))
    return [
        committed(made, k, frame.pose, frame.translation, frame.cost, errors=True) for k, frame in enumerate(frames)
    ]


def _built(
    env: VectorEnv[Any, Any, Any], name: str, seed: int, evaluations: int, settings: dict[str, Any]
) -> Optimiser:
    offer = registry().offer("optimiser", name)
    filled = planned(offer.factory, settings, evaluations)
    check(offer.name, offer.factory, filled)
    space = env.unwrapped.search_spaces[0]  # type: ignore[attr-defined]
    made: Optimiser = offer.factory(space, np.random.default_rng(seed), **filled)
    return made


def _costs(env: VectorEnv[Any, Any, Any], proposals: Any) -> Any:
    if len(proposals) % env.num_envs:
        raise error.Error(f"a population must be a multiple of num_envs {env.num_envs}, got {len(proposals)}")
    costs = np.empty(len(proposals))
    for row in range(0, len(proposals), env.num_envs):
        _, _, _, _, infos = env.step(proposals[row : row + env.num_envs])
        if not np.all(infos.get("_cost", False)):
            raise error.Error("an episode must not end before the search: raise max_evaluations, lower target_cost")
        costs[row : row + env.num_envs] = infos["cost"]
    return costs
