"""How long a step of environments takes, natively and one by one."""

from collections.abc import Callable
from typing import Any

import numpy as np

from posefit_experiments.bench.timing import fastest

ENVIRONMENTS = 40


def vector_env() -> dict[str, float]:
    """Return what a step of 40 environments takes a proposal, in microseconds: natively, and one by one.

    `kernel_us` is the cost of the same proposals through the library. The environments are found by name, as by users.
    """
    import gymnasium

    arguments: dict[str, Any] = {"instance": 3, "max_evaluations": 10**9, "target_cost": -1.0}
    name = "posefit_envs:posefit/Fit-v0"
    native: Any = gymnasium.make_vec(name, ENVIRONMENTS, **arguments)
    single: Any = gymnasium.make_vec(name, ENVIRONMENTS, "sync", **arguments)
    for env in (native, single):
        env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, native.action_space.shape).astype(np.float32)
    problem = native.unwrapped.problems[0]
    proposals = actions.astype(np.float64)
    jobs: dict[str, Callable[[], object]] = {
        "kernel": lambda: problem.evaluate(proposals),
        "native": lambda: native.step(actions),
        "sync": lambda: single.step(actions),
    }
    us = {name: 1e6 * seconds / ENVIRONMENTS for name, seconds in fastest(jobs).items()}
    native.close()
    single.close()
    return {
        "kernel_us": us["kernel"],
        "us_per_proposal": us["native"],
        "overhead_us": us["native"] - us["kernel"],
        "sync_us_per_proposal": us["sync"],
        "times_sync": us["sync"] / us["native"],
    }
