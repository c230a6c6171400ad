"""Runs an optimiser against a vector environment, so that what searches a library searches an environment."""

from typing import Any

import numpy as np
from gymnasium import error
from gymnasium.vector import VectorEnv

from posefit import Minimum, Optimiser, minimise
from posefit.fitting.optimiser import BudgetError
from posefit.registry import registry
from posefit.settings import check, planned


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
